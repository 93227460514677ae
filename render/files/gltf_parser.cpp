#include "render/files/gltf_parser.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <tiny_gltf.h>

#include "core/error.h"
#include "render/files/obj_parser.h"

namespace weft::render {
namespace {

constexpr int kDeepestNode = 64;
constexpr std::size_t kMostNodes = 100'000;

[[noreturn]] void refuse(const std::string& name, const std::string& what,
                         core::Code code = core::Code::kInvalidArgument) {
  throw core::Error(code, name + ": " + what);
}

template <class Item>
const Item& item(const std::vector<Item>& items, int index, const std::string& name,
                 const char* what) {
  if (index < 0 || static_cast<std::size_t>(index) >= items.size()) {
    refuse(name, std::string("it names ") + what + " " + std::to_string(index) +
                     ", which is missing; export it again");
  }
  return items[static_cast<std::size_t>(index)];
}

// The numbers of an accessor, checked to lie in their buffer.
class Numbers {
 public:
  // `components`: of each element.
  Numbers(const tinygltf::Model& model, int accessor, std::size_t components,
          const std::string& name)
      : name_(name) {
    const tinygltf::Accessor& about = item(model.accessors, accessor, name, "accessor");
    if (about.sparse.isSparse || about.bufferView < 0) {
      refuse(name, "an accessor is sparse or has no data; export the mesh without");
    }
    const tinygltf::BufferView& view = item(model.bufferViews, about.bufferView, name, "view");
    const tinygltf::Buffer& buffer = item(model.buffers, view.buffer, name, "buffer");
    const int of_type = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(about.type));
    const int size =
        tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(about.componentType));
    if (of_type != static_cast<int>(components) || size <= 0) {
      refuse(name, "an accessor is of another type than its use; export it again");
    }
    kind_ = about.componentType;
    normalized_ = about.normalized;
    component_bytes_ = static_cast<std::size_t>(size);
    const std::size_t element = components * component_bytes_;
    stride_ = view.byteStride == 0 ? element : view.byteStride;
    count_ = about.count;
    const std::size_t in_buffer =
        buffer.data.size() - std::min(view.byteOffset, buffer.data.size());
    const std::size_t bytes = std::min(in_buffer, view.byteLength);
    const bool starts = about.byteOffset <= bytes;
    const std::size_t room = starts ? bytes - about.byteOffset : 0;
    if (!starts || stride_ < element || count_ > bytes ||
        (count_ > 0 && (room < element || (room - element) / stride_ < count_ - 1))) {
      refuse(name, "an accessor reaches beyond its buffer; export the mesh again");
    }
    if (count_ > 0) {
      data_ = buffer.data.data() + view.byteOffset + about.byteOffset;
    }
  }

  [[nodiscard]] std::size_t count() const { return count_; }

  // A component of an element as glTF means it: normalized whole numbers as shares.
  [[nodiscard]] double at(std::size_t element, std::size_t component) const {
    const unsigned char* place = data_ + element * stride_ + component * component_bytes_;
    switch (kind_) {
      case TINYGLTF_COMPONENT_TYPE_FLOAT:
        return static_cast<double>(load<float>(place));
      case TINYGLTF_COMPONENT_TYPE_BYTE:
        return share(load<std::int8_t>(place));
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        return share(load<std::uint8_t>(place));
      case TINYGLTF_COMPONENT_TYPE_SHORT:
        return share(load<std::int16_t>(place));
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        return share(load<std::uint16_t>(place));
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        return static_cast<double>(load<std::uint32_t>(place));
      default:
        refuse(name_, "an accessor has numbers of a kind that glTF does not know");
    }
  }

 private:
  template <class T>
  static T load(const unsigned char* place) {
    T value;
    std::memcpy(&value, place, sizeof(T));
    return value;
  }
  template <class T>
  [[nodiscard]] double share(T value) const {
    return normalized_ ? std::max(-1.0, value / static_cast<double>(std::numeric_limits<T>::max()))
                       : static_cast<double>(value);
  }

  const unsigned char* data_ = nullptr;
  const std::string& name_;
  std::size_t count_ = 0;
  std::size_t stride_ = 0;
  std::size_t component_bytes_ = 0;
  int kind_ = 0;
  bool normalized_ = false;
};

glm::dmat4 matrix_of(const tinygltf::Node& node) {
  glm::dmat4 matrix(1);
  if (node.matrix.size() == 16) {
    for (int i = 0; i < 16; ++i) {
      matrix[i / 4][i % 4] = node.matrix[static_cast<std::size_t>(i)];
    }
    return matrix;
  }
  if (node.rotation.size() == 4) {
    matrix = glm::dmat4(glm::mat3_cast(glm::normalize(
        glm::dquat(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]))));
  }
  if (node.scale.size() == 3) {
    for (int i = 0; i < 3; ++i) {
      matrix[i] *= node.scale[static_cast<std::size_t>(i)];
    }
  }
  if (node.translation.size() == 3) {
    matrix[3] = glm::dvec4(node.translation[0], node.translation[1], node.translation[2], 1);
  }
  return matrix;
}

class MeshMaker {
 public:
  MeshMaker(const tinygltf::Model& model, const std::string& name) : model_(model), name_(name) {}

  ObjMesh make() {
    const int scene = model_.defaultScene >= 0 ? model_.defaultScene : 0;
    for (const int node : item(model_.scenes, scene, name_, "scene").nodes) {
      visit(node, glm::dmat4(1), 0);
    }
    if (mesh_.triangles.empty()) {
      refuse(name_, "no triangles; give a mesh with faces");
    }
    return std::move(mesh_);
  }

 private:
  void visit(int index, const glm::dmat4& above, int depth) {
    if (depth > kDeepestNode || ++visited_ > kMostNodes) {
      refuse(name_, "its nodes are nested too deeply, or too many; join the meshes");
    }
    const tinygltf::Node& node = item(model_.nodes, index, name_, "node");
    const glm::dmat4 to_scene = above * matrix_of(node);
    if (node.mesh >= 0) {
      for (const auto& primitive : item(model_.meshes, node.mesh, name_, "mesh").primitives) {
        add(primitive, to_scene);
      }
    }
    for (const int child : node.children) {
      visit(child, to_scene, depth + 1);
    }
  }

  void add(const tinygltf::Primitive& primitive, const glm::dmat4& to_scene) {
    const int mode = primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
    if (mode != TINYGLTF_MODE_TRIANGLES && mode != TINYGLTF_MODE_TRIANGLE_STRIP &&
        mode != TINYGLTF_MODE_TRIANGLE_FAN) {
      return;  // points and lines have no faces
    }
    const auto position = primitive.attributes.find("POSITION");
    const auto texture = primitive.attributes.find("TEXCOORD_0");
    if (position == primitive.attributes.end()) {
      refuse(name_, "a mesh has no points; export it again");
    }
    if (texture == primitive.attributes.end()) {
      refuse(name_,
             "a mesh has no texture coordinates, which say how the cloth lies; unwrap it and "
             "export it with TEXCOORD_0");
    }
    const Numbers points(model_, position->second, 3, name_);
    const Numbers places(model_, texture->second, 2, name_);
    if (places.count() != points.count()) {
      refuse(name_, "a mesh has more points than texture coordinates, or fewer; export it again");
    }
    const std::vector<std::uint32_t> numbers = taken(points, to_scene);
    std::vector<std::size_t> corners;
    if (primitive.indices >= 0) {
      const Numbers indices(model_, primitive.indices, 1, name_);
      for (std::size_t i = 0; i < indices.count(); ++i) {
        const double index = indices.at(i, 0);
        if (!(index >= 0 && index < static_cast<double>(points.count()))) {
          refuse(name_, "a face names a point that is missing; mend the mesh");
        }
        corners.push_back(static_cast<std::size_t>(index));
      }
    } else {
      for (std::size_t i = 0; i < points.count(); ++i) {
        corners.push_back(i);
      }
    }
    const bool mirrored = glm::determinant(glm::dmat3(to_scene)) < 0;
    const std::size_t step = mode == TINYGLTF_MODE_TRIANGLES ? 3 : 1;
    for (std::size_t i = 0; i + 2 < corners.size(); i += step) {
      const bool fan = mode == TINYGLTF_MODE_TRIANGLE_FAN;
      const bool odd = mode == TINYGLTF_MODE_TRIANGLE_STRIP && i % 2 == 1;
      std::array<std::size_t, 3> face = {corners[fan ? 0 : i], corners[i + 1], corners[i + 2]};
      if (odd != mirrored) {
        std::swap(face[1], face[2]);
      }
      add_triangle(face, numbers, places);
    }
  }

  // The points of a mesh in the scene, each once: what number each of them has.
  std::vector<std::uint32_t> taken(const Numbers& points, const glm::dmat4& to_scene) {
    std::vector<std::uint32_t> numbers(points.count());
    for (std::size_t i = 0; i < points.count(); ++i) {
      const glm::dvec3 point(to_scene *
                             glm::dvec4(points.at(i, 0), points.at(i, 1), points.at(i, 2), 1));
      if (!is_usable(point)) {
        refuse(name_, "a point is not finite or farther than 1e9 from the origin; mend the mesh");
      }
      const auto [found, fresh] =
          places_.try_emplace(std::make_tuple(point.x, point.y, point.z),
                              static_cast<std::uint32_t>(mesh_.points.size()));
      if (fresh) {
        if (mesh_.points.size() >= kPointLimit) {
          refuse(name_, "more than " + std::to_string(kPointLimit) + " points; use a coarser mesh",
                 core::Code::kResourceExhausted);
        }
        mesh_.points.push_back(point);
      }
      numbers[i] = found->second;
    }
    return numbers;
  }

  void add_triangle(const std::array<std::size_t, 3>& face,
                    const std::vector<std::uint32_t>& numbers, const Numbers& places) {
    ObjMesh::Triangle triangle{};
    for (std::size_t corner = 0; corner < 3; ++corner) {
      triangle.points[corner] = numbers[face[corner]];
      // glTF's v runs down the picture.
      triangle.texture[corner] = {places.at(face[corner], 0), 1 - places.at(face[corner], 1)};
      if (!is_usable(triangle.texture[corner])) {
        refuse(name_, "a texture coordinate is not finite or beyond 1e9; mend the mesh");
      }
    }
    const glm::dvec3& a = mesh_.points[triangle.points[0]];
    const glm::dvec3 cross =
        glm::cross(mesh_.points[triangle.points[1]] - a, mesh_.points[triangle.points[2]] - a);
    if (!(glm::dot(cross, cross) > 0)) {
      return;
    }
    if (mesh_.triangles.size() >= kTriangleLimit) {
      refuse(name_,
             "more than " + std::to_string(kTriangleLimit) + " triangles; use a coarser mesh",
             core::Code::kResourceExhausted);
    }
    mesh_.triangles.push_back(triangle);
  }

  const tinygltf::Model& model_;
  const std::string& name_;
  ObjMesh mesh_;
  std::map<std::tuple<double, double, double>, std::uint32_t> places_;
  std::size_t visited_ = 0;
};

void check_extensions(const tinygltf::Model& model, const std::string& name) {
  for (const std::string& extension : model.extensionsRequired) {
    // What says how surfaces look is not our business; quantized numbers are read.
    if (!extension.starts_with("KHR_materials_") && !extension.starts_with("KHR_texture_") &&
        !extension.starts_with("EXT_texture_") && extension != "KHR_mesh_quantization") {
      refuse(name, "it needs the extension " + extension +
                       ", which is not read; export it without (no compression)");
    }
  }
}

}  // namespace

ObjMesh parse_gltf(const std::string& bytes, const std::string& name) {
  tinygltf::TinyGLTF loader;
  // Nothing but the file itself is read, and no picture in it.
  loader.SetFsCallbacks(
      {[](const std::string&, void*) { return false; },
       [](const std::string& path, void*) { return path; },
       [](std::vector<unsigned char>*, std::string* error, const std::string& path, void*) {
         *error = path + " is another file";
         return false;
       },
       nullptr, nullptr});
  loader.SetImageLoader([](tinygltf::Image*, int, std::string*, std::string*, int, int,
                           const unsigned char*, int, void*) { return true; },
                        nullptr);
  tinygltf::Model model;
  std::string mistake;
  std::string warning;
  const auto size = static_cast<unsigned int>(bytes.size());
  const bool read =
      bytes.starts_with("glTF")
          ? loader.LoadBinaryFromMemory(&model, &mistake, &warning,
                                        reinterpret_cast<const unsigned char*>(bytes.data()), size)
          : loader.LoadASCIIFromString(&model, &mistake, &warning, bytes.data(), size, "");
  if (!read) {
    if (mistake.find("File not found") != std::string::npos) {
      refuse(name, "its points lie in another file; export it as .glb, or with embedded buffers");
    }
    while (!mistake.empty() && mistake.back() == '\n') {
      mistake.pop_back();
    }
    refuse(name, "not a glTF file that can be read: " + mistake);
  }
  check_extensions(model, name);
  return MeshMaker(model, name).make();
}

core::SandboxHandler gltf_handler() {
  return {[] {},
          [](std::span<const std::byte> file, const std::vector<std::string>& arguments,
             core::FlatWriter& answer) {
            const std::string bytes(reinterpret_cast<const char*>(file.data()), file.size());
            hand_over(parse_gltf(bytes, arguments.at(0)), answer);
          }};
}

}  // namespace weft::render
