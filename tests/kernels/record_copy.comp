#version 450
#extension GL_EXT_scalar_block_layout : require

// Writes the fields of one record, word by word.
layout(local_size_x = 1) in;
layout(constant_id = 0) const int kRecord = 0;

// Nothing here reads these.
#define SOLID_BINDING 2
#define GRID_BINDING 7
#include "render/kernels/grid.glsl"

#include "tests/kernels/record_fields.h"

layout(set = 0, binding = 0, scalar) readonly buffer Hits { DeviceHit hit; };
layout(set = 0, binding = 0, scalar) readonly buffer Cloths { DeviceCloth cloth; };
layout(set = 0, binding = 0, scalar) readonly buffer Tetrahedra { DeviceTetrahedron tetrahedron; };
layout(set = 0, binding = 0, scalar) readonly buffer Triangles { DeviceShellTriangle triangle; };
layout(set = 0, binding = 0, scalar) readonly buffer Nodes { DeviceNode node; };
layout(set = 0, binding = 0, scalar) readonly buffer OuterFaces { DeviceOuterFace outer_face; };
layout(set = 0, binding = 0, scalar) readonly buffer FabricSizes { DeviceFabricSizes fabric_sizes; };
layout(set = 0, binding = 0, scalar) readonly buffer Segments { DeviceSegment segment; };
layout(set = 0, binding = 0, scalar) readonly buffer Lights { DeviceLight light; };
layout(set = 0, binding = 0, scalar) readonly buffer Samples { DeviceSample eye_sample; };
layout(set = 0, binding = 0, scalar) readonly buffer Pixels { DevicePixel pixel; };
layout(set = 0, binding = 0, scalar) readonly buffer Calls { ShadingCall call; };
layout(set = 0, binding = 0, scalar) readonly buffer Fabrics { DeviceFabric fabric; };
layout(set = 0, binding = 0, scalar) readonly buffer Capsules { DeviceCapsule capsule; };
layout(set = 0, binding = 0, scalar) readonly buffer Tasks { EyeTask task; };
layout(set = 0, binding = 0, scalar) readonly buffer Searches { EyeSearch search; };
layout(set = 0, binding = 1, scalar) writeonly buffer Words { uint words[]; };

uint at = 0;

void put(uint x) { words[at++] = x; }
void put(int x) { put(uint(x)); }
void put(float x) { put(floatBitsToUint(x)); }
void put(vec2 x) { put(x.x); put(x.y); }
void put(vec3 x) { put(x.xy); put(x.z); }
void put(vec4 x) { put(x.xy); put(x.zw); }
void put(uvec2 x) { put(x.x); put(x.y); }
void put(ivec2 x) { put(x.x); put(x.y); }
void put(ivec3 x) { put(x.x); put(x.y); put(x.z); }
void put(mat3 x) { put(x[0]); put(x[1]); put(x[2]); }

#define PUT_HIT(name) put(hit.name);
#define PUT_CLOTH(name) put(cloth.name);
#define PUT_TETRAHEDRON(name) put(tetrahedron.name);
#define PUT_TRIANGLE(name) put(triangle.name);
#define PUT_NODE(name) put(node.name);
#define PUT_OUTER_FACE(name) put(outer_face.name);
#define PUT_FABRIC_SIZES(name) put(fabric_sizes.name);
#define PUT_SEGMENT(name) put(segment.name);
#define PUT_LIGHT(name) put(light.name);
#define PUT_SAMPLE(name) put(eye_sample.name);
#define PUT_PIXEL(name) put(pixel.name);
#define PUT_SHADING_CALL(name) put(call.name);
#define PUT_FABRIC(name) put(fabric.name);
#define PUT_CAPSULE(name) put(capsule.name);
#define PUT_EYE_TASK(name) put(task.name);
#define PUT_EYE_SEARCH(name) put(search.name);

void main() {
  switch (kRecord) {
    case 0:
      FIELDS_OF_HIT(PUT_HIT)
      break;
    case 1:
      FIELDS_OF_CLOTH(PUT_CLOTH)
      break;
    case 2:
      FIELDS_OF_TETRAHEDRON(PUT_TETRAHEDRON)
      break;
    case 3:
      FIELDS_OF_SHELL_TRIANGLE(PUT_TRIANGLE)
      break;
    case 4:
      FIELDS_OF_NODE(PUT_NODE)
      break;
    case 5:
      FIELDS_OF_OUTER_FACE(PUT_OUTER_FACE)
      break;
    case 6:
      FIELDS_OF_FABRIC_SIZES(PUT_FABRIC_SIZES)
      break;
    case 7:
      FIELDS_OF_SEGMENT(PUT_SEGMENT)
      break;
    case 8:
      FIELDS_OF_LIGHT(PUT_LIGHT)
      break;
    case 9:
      FIELDS_OF_SAMPLE(PUT_SAMPLE)
      break;
    case 10:
      FIELDS_OF_PIXEL(PUT_PIXEL)
      break;
    case 11:
      FIELDS_OF_SHADING_CALL(PUT_SHADING_CALL)
      break;
    case 12:
      FIELDS_OF_FABRIC(PUT_FABRIC)
      break;
    case 13:
      FIELDS_OF_CAPSULE(PUT_CAPSULE)
      break;
    case 14:
      FIELDS_OF_EYE_TASK(PUT_EYE_TASK)
      break;
    case 15:
      FIELDS_OF_EYE_SEARCH(PUT_EYE_SEARCH)
      break;
  }
}
