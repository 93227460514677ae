#include <array>
#include <cstring>
#include <string>
#include <vector>

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "render/obj_mesh.h"

namespace weft::render {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

// Two squares beside each other over a seam: their common edge stands twice, as glTF has it.
struct Squares {
  std::vector<float> points = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0,
                               1, 0, 0, 2, 0, 0, 2, 1, 0, 1, 1, 0};
  std::vector<float> texture = {0, 1, 1, 1, 1, 0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0};
  std::vector<std::uint16_t> indices = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7};
  json gltf;

  Squares() {
    gltf = json::parse(R"({
      "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
      "nodes": [{"mesh": 0}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2}]}],
      "buffers": [{"byteLength": 184}],
      "bufferViews": [{"buffer": 0, "byteLength": 96},
                      {"buffer": 0, "byteOffset": 96, "byteLength": 64},
                      {"buffer": 0, "byteOffset": 160, "byteLength": 24}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3",
                     "min": [0, 0, 0], "max": [2, 1, 0]},
                    {"bufferView": 1, "componentType": 5126, "count": 8, "type": "VEC2"},
                    {"bufferView": 2, "componentType": 5123, "count": 12, "type": "SCALAR"}]})");
  }

  // Binary glTF: a header, the JSON padded with blanks, the buffer.
  [[nodiscard]] std::string glb() const {
    std::string text = gltf.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const std::string data = bytes_of(points) + bytes_of(texture) + bytes_of(indices);
    const auto word = [](std::size_t value) {
      return bytes_of(std::vector<std::uint32_t>{static_cast<std::uint32_t>(value)});
    };
    return "glTF" + word(2) + word(28 + text.size() + data.size()) + word(text.size()) + "JSON" +
           text + word(data.size()) + std::string("BIN\0", 4) + data;
  }
};

std::string mistake_in(const std::string& bytes, const std::string& name = "m.glb") {
  try {
    (void)read_mesh_text(bytes, name);
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
    return error.what();
  }
  return "nothing was wrong";
}

TEST(Gltf, TrianglesComeWithTheirTextureAndPointsAtOnePlaceAreOne) {
  const ObjMesh mesh = read_mesh_text(Squares().glb(), "squares.GLB");
  EXPECT_EQ(mesh.points.size(), 6U);
  ASSERT_EQ(mesh.triangles.size(), 4U);
  // v runs up here, down there.
  EXPECT_EQ(mesh.triangles[0].texture[0], glm::dvec2(0, 0));
  EXPECT_EQ(mesh.triangles[0].texture[2], glm::dvec2(1, 1));
  EXPECT_EQ(mesh.points[mesh.triangles[2].points[1]], glm::dvec3(2, 0, 0));
  // The seam has one edge and two textures.
  EXPECT_EQ(mesh.triangles[0].points[1], mesh.triangles[2].points[0]);
  EXPECT_NE(mesh.triangles[0].texture[1], mesh.triangles[2].texture[0]);
}

TEST(Gltf, NodesTurnScaleAndMoveAndMirrorsKeepTheUpperSide) {
  Squares squares;
  const double h = std::sqrt(0.5);
  squares.gltf["nodes"] =
      json::array({{{"children", {1}}, {"translation", {10, 0, 0}}},
                   {{"mesh", 0}, {"rotation", {0, 0, h, h}}, {"scale", {-2, 3, 1}}}});
  const ObjMesh mesh = read_mesh_text(squares.glb(), "m.glb");
  // (2, 1, 0) is scaled to (-4, 3, 0), turned by a quarter to (-3, -4, 0), moved by 10.
  const glm::dvec3 corner = mesh.points[mesh.triangles[2].points[1]];
  double nearest = 1;
  for (const glm::dvec3& point : mesh.points) {
    nearest = std::min(nearest, glm::distance(point, glm::dvec3(7, -4, 0)));
  }
  EXPECT_LT(nearest, 1e-12);
  EXPECT_TRUE(std::isfinite(corner.x));
  for (const ObjMesh::Triangle& triangle : mesh.triangles) {
    const glm::dvec3& a = mesh.points[triangle.points[0]];
    EXPECT_GT(
        glm::cross(mesh.points[triangle.points[1]] - a, mesh.points[triangle.points[2]] - a).z, 0);
  }
}

TEST(Gltf, StripsFansAndMeshesWithoutIndicesAreTriangles) {
  Squares squares;
  auto& primitive = squares.gltf["meshes"][0]["primitives"][0];
  primitive["mode"] = 6;  // a fan round point 0
  squares.indices = {0, 1, 2, 3, 3, 3, 3, 3, 3, 3, 3, 3};
  EXPECT_EQ(read_mesh_text(squares.glb(), "m.glb").triangles.size(), 2U);
  primitive["mode"] = 5;
  squares.indices = {0, 1, 3, 2, 2, 2, 2, 2, 2, 2, 2, 2};
  const ObjMesh strip = read_mesh_text(squares.glb(), "m.glb");
  ASSERT_EQ(strip.triangles.size(), 2U);
  const ObjMesh::Triangle& odd = strip.triangles[1];
  const glm::dvec3& a = strip.points[odd.points[0]];
  EXPECT_GT(glm::cross(strip.points[odd.points[1]] - a, strip.points[odd.points[2]] - a).z, 0);
  primitive.erase("mode");
  primitive.erase("indices");
  squares.gltf["accessors"][0]["count"] = 6;
  squares.gltf["accessors"][1]["count"] = 6;
  EXPECT_EQ(read_mesh_text(squares.glb(), "m.glb").triangles.size(), 2U);
}

TEST(Gltf, TextWithItsBufferWithinIsTheSame) {
  Squares squares;
  const std::string data =
      bytes_of(squares.points) + bytes_of(squares.texture) + bytes_of(squares.indices);
  constexpr const char* kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string base64;
  for (std::size_t i = 0; i < data.size(); i += 3) {
    unsigned group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8 | (i + k < data.size() ? static_cast<unsigned char>(data[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      base64 += i + k > data.size() ? '=' : kDigits[group >> (18 - 6 * k) & 63U];
    }
  }
  squares.gltf["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64;
  const ObjMesh text = read_mesh_text(squares.gltf.dump(), "squares.gltf");
  const ObjMesh binary = read_mesh_text(Squares().glb(), "squares.glb");
  EXPECT_EQ(text.points, binary.points);
  EXPECT_EQ(text.triangles.size(), binary.triangles.size());
}

TEST(Gltf, WhatIsWrongIsSaidAndNothingElseIsOpened) {
  Squares squares;
  EXPECT_THAT(mistake_in("hello"), HasSubstr("m.glb: not a glTF file that can be read"));
  squares.gltf["buffers"][0]["uri"] = "points.bin";
  EXPECT_THAT(mistake_in(squares.gltf.dump(), "m.gltf"),
              HasSubstr("its points lie in another file"));
  squares.gltf["buffers"][0]["uri"] = "/etc/hostname";
  EXPECT_THAT(mistake_in(squares.gltf.dump(), "m.gltf"),
              HasSubstr("its points lie in another file"));
  squares = Squares();
  squares.gltf["extensionsRequired"] = json::array({"KHR_draco_mesh_compression"});
  EXPECT_THAT(mistake_in(squares.glb()),
              HasSubstr("needs the extension KHR_draco_mesh_compression"));
  squares = Squares();
  squares.gltf["meshes"][0]["primitives"][0]["attributes"].erase("TEXCOORD_0");
  EXPECT_THAT(mistake_in(squares.glb()), HasSubstr("no texture coordinates"));
  squares = Squares();
  squares.gltf["accessors"][0]["count"] = 9;
  EXPECT_THAT(mistake_in(squares.glb()), HasSubstr("reaches beyond its buffer"));
  squares = Squares();
  squares.indices[3] = 8;
  EXPECT_THAT(mistake_in(squares.glb()), HasSubstr("names a point that is missing"));
  squares = Squares();
  squares.points[4] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(mistake_in(squares.glb()), HasSubstr("a point is not finite"));
  squares = Squares();
  squares.gltf["nodes"][0]["children"] = json::array({0});  // itself
  EXPECT_THAT(mistake_in(squares.glb()), HasSubstr("nested too deeply"));
}

TEST(Gltf, ACutFileIsRefused) {
  const std::string whole = Squares().glb();
  for (std::size_t size = 0; size < whole.size(); size += 97) {
    EXPECT_NE(mistake_in(whole.substr(0, size)), "nothing was wrong") << size;
  }
}

}  // namespace
}  // namespace weft::render
