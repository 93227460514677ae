#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "core/random.h"
#include "render/draw.h"
#include "render/flat_cloth.h"
#include "render/obj_mesh.h"
#include "render/path_integrator.h"
#include "render/shell_cloth.h"
#include "render/shell_geometry.h"
#include "tests/render_cloths.h"
#include "tests/transport_tiles.h"

namespace weft::render {
namespace {

using test::sheet;

glm::dmat3 rotation_about_x(double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return {glm::dvec3(1, 0, 0), glm::dvec3(0, c, s), glm::dvec3(0, -s, c)};
}

shading::FibreMaterial material() {
  shading::FibreMaterial result;
  result.c_r = {0.3f, 0.2f, 0.1f};
  result.c_tt = {0.6f, 0.5f, 0.4f};
  result.beta_r = 0.12f;
  result.beta_tt = 0.17f;
  result.gamma_tt = 0.35f;
  return result;
}

std::shared_ptr<const Fabric> fabric() {
  fabric::Tile tile = test::crossed_layers(4, 6, 0.05f, 2);
  // Centred on z = 0, as a swatch's mid-plane is.
  const float middle = 0.5f * (tile.z_min_mm + tile.z_max_mm);
  for (glm::vec3& point : tile.points_mm) {
    point.z -= middle;
  }
  test::finish(tile);
  return std::make_shared<Fabric>(std::move(tile), std::vector{shading::FibreBcsdf(material())});
}

// The same view of the same light, all turned by `turn`.
void set_view(Scene& scene, const glm::dmat3& turn) {
  Camera::View view;
  view.position_mm = turn * glm::dvec3(0.5, -2, 4);
  view.look_at_mm = turn * glm::dvec3(0.1, 0.2, 0);
  view.up = turn * glm::dvec3(0, 1, 0);
  view.height = 0.2;
  scene.camera = Camera(view, 1.0);
  scene.lights.emplace_back(
      SgLight{turn * glm::normalize(glm::dvec3(-0.4, 0.5, 1)), 30, {2, 2, 2}});
}

Drawing drawing_of(const Scene& scene, bool local, std::uint64_t seed) {
  PathSettings path;
  path.local = local;
  const PathIntegrator integrator(scene, path);
  DrawSettings settings;
  settings.width = settings.height = 16;
  settings.samples_per_pixel = 60;
  settings.seed = seed;
  return draw(
      scene.camera, integrator, settings, [](double) {}, [] { return false; });
}

ShellPlacement true_to_size() {
  ShellPlacement placement;
  placement.texture_mm = {1, 1};
  return placement;
}

TEST(Shell, AFlatSheetShowsWhatAFlatSwatchShows) {
  const auto cloth = fabric();
  for (const double angle : {0.0, 0.6}) {
    const glm::dmat3 turn = rotation_about_x(angle);
    for (const bool underlay : {false, true}) {
      Scene flat;
      FlatPlacement swatch;
      swatch.size_mm = {6, 6};
      swatch.black_underlay = underlay;
      flat.cloths.push_back(make_flat_cloth(cloth, swatch));
      set_view(flat, glm::dmat3(1));
      Scene shell;
      std::vector<std::string> remarks;
      ShellPlacement placement = true_to_size();
      placement.black_underlay = underlay;
      shell.cloths.push_back(make_shell_cloth(
          cloth, sheet(7, 3, [&](glm::dvec2 p) { return turn * glm::dvec3(p, 0); }), placement,
          remarks));
      EXPECT_TRUE(remarks.empty());
      set_view(shell, turn);
      for (const bool local : {false, true}) {
        const Drawing a = drawing_of(flat, local, 3);
        const Drawing b = drawing_of(shell, local, 4);
        EXPECT_EQ(a.cloth_share > 0.9, b.cloth_share > 0.9);
        for (int c = 0; c < 3; ++c) {
          const double error = std::hypot(a.cloth_standard_error[c], b.cloth_standard_error[c]);
          // Sidak for 24 comparisons at 0.01 together: 3.5 standard errors.
          EXPECT_LT(std::fabs(a.cloth_mean[c] - b.cloth_mean[c]), 3.5 * error)
              << "angle " << angle << " local " << local << ": " << a.cloth_mean[c] << " against "
              << b.cloth_mean[c];
          EXPECT_GT(a.cloth_mean[c], 20 * a.cloth_standard_error[c]);
        }
      }
    }
  }
}

TEST(Shell, EyeRaysMeetTheSameFibresThroughAShellAndInASwatch) {
  const auto cloth = fabric();
  FlatPlacement swatch;
  swatch.size_mm = {6, 6};
  const auto flat = make_flat_cloth(cloth, swatch);
  std::vector<std::string> remarks;
  const auto shell = make_shell_cloth(
      cloth, sheet(9, 3, [](glm::dvec2 p) { return glm::dvec3(p, 0); }), true_to_size(), remarks);
  int met = 0;
  int different = 0;
  for (std::uint64_t i = 0; i < 4000; ++i) {
    core::Random random(9, 0, i);
    const auto around = [&] { return 2 * random.uniform_double() - 1; };
    const glm::dvec3 from(3 * around(), 3 * around(), i % 2 == 0 ? 2 : -2);
    const glm::dvec3 to(2 * around(), 2 * around(), 0);
    const Ray ray{from, glm::normalize(to - from)};
    const Meeting a = flat->closest(ray, kInfinity, nullptr);
    const Meeting b = shell->closest(ray, kInfinity, nullptr);
    if (a.fate == Fate::kFibre) {
      ++met;
    }
    // Rays that graze a fibre may fall on either side of it by rounding.
    if (a.fate != b.fate || (a.fate == Fate::kFibre && (std::fabs(a.t_mm - b.t_mm) > 1e-4 ||
                                                        a.hit.segment != b.hit.segment))) {
      ++different;
    }
    if (a.fate == Fate::kFibre && b.fate == Fate::kFibre) {
      const auto top_a = flat->top_point(a.hit, {0.3, -0.2});
      const auto top_b = shell->top_point(b.hit, {0.3, -0.2});
      ASSERT_TRUE(top_a && top_b);
      if (a.hit.segment == b.hit.segment) {
        EXPECT_LT(glm::distance(*top_a, *top_b), 2e-4);
      }
    }
  }
  EXPECT_GT(met, 2000);
  EXPECT_LT(different, 8);
}

TEST(Shell, TopPointsFollowTheTextureAcrossTrianglesAndEndAtTheBorder) {
  const auto cloth = fabric();
  std::vector<std::string> remarks;
  // Half a tube of radius 2 about the y axis, its texture the length along the arc.
  const auto tube = [](glm::dvec2 p) {
    return glm::dvec3(2 * std::sin(p.x / 2), p.y, 2 * std::cos(p.x / 2));
  };
  const auto shell = make_shell_cloth(cloth, sheet(60, 3, tube), true_to_size(), remarks);
  EXPECT_TRUE(remarks.empty());
  const Meeting meeting = shell->closest({{0.05, 0.1, 10}, {0, 0, -1}}, kInfinity, nullptr);
  ASSERT_EQ(meeting.fate, Fate::kFibre);
  const double half_thickness =
      0.5 * static_cast<double>(cloth->tile().z_max_mm - cloth->tile().z_min_mm);
  for (const double along : {-2.0, -0.4, 0.0, 1.1, 2.4}) {
    const auto top = shell->top_point(meeting.hit, {along, 0.5});
    ASSERT_TRUE(top.has_value());
    const double arc = meeting.hit.flat_mm.x + along;
    EXPECT_NEAR(top->x, (2 + half_thickness) * std::sin(arc / 2), 2e-2);
    EXPECT_NEAR(top->z, (2 + half_thickness) * std::cos(arc / 2), 2e-2);
    // Straight up from there it is free, through the tube it is not.
    const glm::dvec3 out = glm::normalize(glm::dvec3(top->x, 0, top->z));
    EXPECT_FALSE(shell->blocks({*top, out}, kInfinity));
    EXPECT_TRUE(shell->blocks({*top, -out}, kInfinity));
  }
  EXPECT_FALSE(shell->top_point(meeting.hit, {3.5, 0}).has_value());
  EXPECT_FALSE(shell->top_point(meeting.hit, {0, -3.5}).has_value());
}

TEST(Shell, PolarFactorIsTheRotationOfARotatedStretch) {
  const glm::dmat3 turn = rotation_about_x(0.8);
  const glm::dmat3 stretch(glm::dvec3(2, 0.3, 0), glm::dvec3(0.3, 1.5, 0.1),
                           glm::dvec3(0, 0.1, 0.7));
  const glm::dmat3 mirror(glm::dvec3(-1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1));
  for (const glm::dmat3& orthogonal : {turn, turn * mirror}) {
    const glm::dmat3 factor = polar_factor(orthogonal * stretch);
    for (int column = 0; column < 3; ++column) {
      EXPECT_LT(glm::distance(factor[column], orthogonal[column]), 1e-12);
    }
  }
}

TEST(Shell, TetrahedraFillThePrismsAndAgreeAboutTheirNeighbours) {
  const ObjMesh mesh =
      sheet(4, 3, [](glm::dvec2 p) { return glm::dvec3(p, 0.3 * std::sin(p.x) * std::cos(p.y)); });
  ShellShape shape;
  shape.thickness_mm = 0.2;
  shape.flat_low_mm = -0.1;
  shape.flat_high_mm = 0.1;
  const ShellGeometry shell = build_shell(mesh, shape);
  EXPECT_EQ(shell.folded, 0U);
  EXPECT_EQ(shell.bare, 0U);
  int tops = 0;
  for (std::int32_t k = 0; k < static_cast<std::int32_t>(shell.tetrahedra.size()); ++k) {
    for (std::size_t face = 0; face < 4; ++face) {
      const std::int32_t behind = shell.tetrahedra[static_cast<std::size_t>(k)].behind[face];
      tops += behind == static_cast<std::int32_t>(Outside::kTop) ? 1 : 0;
      if (behind < 0) {
        continue;
      }
      const Tetrahedron& there = shell.tetrahedra[static_cast<std::size_t>(behind)];
      const auto back = std::find(there.behind.begin(), there.behind.end(), k);
      ASSERT_NE(back, there.behind.end());
      // The same plane from the other side.
      const auto other = static_cast<std::size_t>(back - there.behind.begin());
      EXPECT_LT(glm::distance(there.normals[other],
                              -shell.tetrahedra[static_cast<std::size_t>(k)].normals[face]),
                1e-9);
    }
  }
  EXPECT_EQ(tops, static_cast<int>(mesh.triangles.size()));
}

TEST(Shell, FoldsAreReported) {
  std::vector<std::string> remarks;
  ShellPlacement placement = true_to_size();
  placement.thickness_mm = 2;
  const auto wave = [](glm::dvec2 p) { return glm::dvec3(p, 0.5 * std::sin(6 * p.x)); };
  static_cast<void>(make_shell_cloth(fabric(), sheet(40, 3, wave), placement, remarks));
  ASSERT_EQ(remarks.size(), 1U);
  EXPECT_NE(remarks[0].find("inside out"), std::string::npos);
}

TEST(ObjMesh, ReadsPolygonsAndRefusesWhatHasNoTexture) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "weft_obj_mesh";
  std::filesystem::create_directories(folder);
  const std::string points = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
  core::write_file_atomically(folder / "quad.obj", points + "f 1/1 2/2 3/3 4/4\n");
  const ObjMesh mesh = read_obj(folder / "quad.obj");
  EXPECT_EQ(mesh.points.size(), 4U);
  EXPECT_EQ(mesh.triangles.size(), 2U);
  for (const auto& [name, text] :
       {std::pair{"bare.obj", points + "f 1 2 3\n"}, std::pair{"empty.obj", points},
        std::pair{"beyond.obj", points + "f 1/1 2/2 9/3\n"},
        std::pair{"flat.obj", points + "f 1/1 1/2 1/3\n"}}) {
    core::write_file_atomically(folder / name, text);
    EXPECT_THROW(static_cast<void>(read_obj(folder / name)), core::Error) << name;
  }
  EXPECT_THROW(static_cast<void>(read_obj(folder / "absent.obj")), core::Error);
  std::filesystem::remove_all(folder);
}

TEST(ObjMesh, RealMeshesLoad) {
  const char* data = std::getenv("WEFT_SHARED_DATA");
  const auto folder = std::filesystem::path(data == nullptr ? "" : data) / "meshes";
  if (data == nullptr || !std::filesystem::is_directory(folder)) {
    GTEST_SKIP() << "WEFT_SHARED_DATA does not name a folder with meshes/";
  }
  std::size_t meshes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".obj") {
      const ObjMesh mesh = read_obj(entry.path());
      EXPECT_GT(mesh.triangles.size(), 1000U) << entry.path();
      EXPECT_GT(mesh.points.size(), 500U) << entry.path();
      ++meshes;
    }
  }
  EXPECT_GT(meshes, 0U) << folder;
}

}  // namespace
}  // namespace weft::render
