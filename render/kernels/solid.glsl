// Buffers of render/kernels/solid.h for a kernel: define SOLID_BINDING, the first of the five
// bindings that they take, and include this. gpu::DeviceGeometry::solid_buffers() has them in order.
#ifndef WEFT_RENDER_KERNELS_SOLID_GLSL
#define WEFT_RENDER_KERNELS_SOLID_GLSL

#define Geometry int
const Geometry kGeometry = 0;  // the only one that a kernel has

#include "render/kernels/cloth_records.h"

layout(set = 0, binding = SOLID_BINDING, scalar) readonly buffer ClothBuffer {
  DeviceCloth device_cloths[];
};
layout(set = 0, binding = SOLID_BINDING + 1, scalar) readonly buffer TetrahedronBuffer {
  DeviceTetrahedron device_tetrahedra[];
};
layout(set = 0, binding = SOLID_BINDING + 2, scalar) readonly buffer ShellTriangleBuffer {
  DeviceShellTriangle device_shell_triangles[];
};
layout(set = 0, binding = SOLID_BINDING + 3, scalar) readonly buffer NodeBuffer {
  DeviceNode device_nodes[];
};
layout(set = 0, binding = SOLID_BINDING + 4, scalar) readonly buffer OuterFaceBuffer {
  DeviceOuterFace device_outer_faces[];
};

DeviceCloth cloth_at(Geometry g, int index) { return device_cloths[index]; }
DeviceTetrahedron tetrahedron_at(Geometry g, int index) { return device_tetrahedra[index]; }
DeviceShellTriangle shell_triangle_at(Geometry g, int index) {
  return device_shell_triangles[index];
}
DeviceNode node_at(Geometry g, int index) { return device_nodes[index]; }
DeviceOuterFace outer_face_at(Geometry g, int index) { return device_outer_faces[index]; }

#include "render/kernels/solid.h"

#endif
