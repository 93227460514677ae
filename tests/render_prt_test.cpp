#include <cmath>
#include <memory>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "render/baselines/prt_integrator.h"
#include "render/baselines/segment_transfer.h"
#include "shading/bcsdf_sh.h"
#include "shading/sh_rotation.h"
#include "tests/transport_tiles.h"

namespace weft::render {
namespace {

std::unique_ptr<Fabric> lonely_fibre(const shading::FibreMaterial& material) {
  fabric::Tile tile = test::empty_tile(10, 10);
  test::add_strand(tile, {{0, 5, 0}, {5, 5, 0}, {10, 5, 0}}, 0.05f, 1, 0);
  test::finish(tile);
  return std::make_unique<Fabric>(std::move(tile), std::vector{shading::FibreBcsdf(material)});
}

// The shading point of a fibre along x, without a database.
ShadingPoint point_on(const shading::FibreBcsdf& bcsdf, const glm::vec3& omega_o) {
  ShadingPoint at;
  at.bcsdf = &bcsdf;
  at.to_fibre = shading::fibre_frame({1, 0, 0}, omega_o);
  at.omega_o = at.to_fibre * omega_o;
  const shading::BcsdfSh harmonics = shading::bcsdf_sh(
      bcsdf.material(), static_cast<double>(shading::fibre_angle(at.omega_o).theta));
  const shading::ShRotation to_flat = shading::sh_rotation(glm::transpose(at.to_fibre));
  for (std::size_t channel = 0; channel < 3; ++channel) {
    shading::ShVector c = shading::sh_zero();
    for (std::size_t j = 0; j < 36; ++j) {
      c.c[j] = static_cast<float>(harmonics[channel][j]);
    }
    at.c_s[channel] = shading::sh_rotate(to_flat, c);
  }
  return at;
}

// S cos(theta) under a normalised spherical Gaussian light, cut at the horizon.
glm::dvec3 integral(const shading::FibreBcsdf& bcsdf, const glm::vec3& omega_o,
                    const shading::SphericalGaussian& light) {
  constexpr int kRows = 200;
  constexpr int kColumns = 400;
  glm::dvec3 sum(0);
  for (int r = 0; r < kRows; ++r) {
    const double z = (r + 0.5) / kRows;
    for (int c = 0; c < kColumns; ++c) {
      const double phi = (c + 0.5) * 2 * static_cast<double>(shading::kPi) / kColumns;
      const double s = std::sqrt(1 - z * z);
      const glm::vec3 omega(s * std::cos(phi), s * std::sin(phi), z);
      sum += glm::dvec3(bcsdf.evaluate_cos(omega, omega_o)) *
             static_cast<double>(shading::sg_evaluate(light, omega));
    }
  }
  return sum * (2 * static_cast<double>(shading::kPi) / kRows / kColumns /
                static_cast<double>(shading::sg_mass(light.sharpness)));
}

TEST(SegmentTransfer, OfALonelySmoothFibreIsItsIntegralAndOfASharpOneRings) {
  shading::FibreMaterial smooth;
  smooth.c_r = {0.3f, 0.5f, 0.9f};
  smooth.c_tt = {0.6f, 0.5f, 0.1f};
  smooth.beta_r = smooth.beta_tt = 0.7f;
  smooth.gamma_tt = 1.0f;
  PrtSettings settings;
  settings.paths = 100000;
  const auto fabric = lonely_fibre(smooth);
  SegmentTransfer transfer(*fabric, settings);
  const glm::vec3 omega_o = glm::normalize(glm::vec3(0.3f, -0.4f, 1.0f));
  const ShadingPoint point = point_on(fabric->bcsdfs()[0], omega_o);
  for (const glm::vec3 axis : {glm::vec3(0, 0, 1), glm::vec3(0.5f, 0.3f, 0.8f)}) {
    const shading::SphericalGaussian light{glm::normalize(axis), 3.0f};
    const glm::vec3 found = radiance_of(point, transfer.transferred(0, harmonics_of_sg(light)));
    const glm::dvec3 expected = integral(fabric->bcsdfs()[0], omega_o, light);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(found[c], expected[c], 0.03 * expected[c]);
    }
  }

  shading::FibreMaterial sharp = smooth;
  sharp.beta_r = sharp.beta_tt = 0.03f;
  const auto silk = lonely_fibre(sharp);
  SegmentTransfer rings(*silk, settings);
  const ShadingPoint at = point_on(silk->bcsdfs()[0], omega_o);
  float lowest = 0;
  float largest = 0;
  for (int i = 0; i < 64; ++i) {
    const float theta = -1.5f + 3.0f * static_cast<float>(i) / 63;
    const shading::SphericalGaussian light{{std::sin(theta), 0, std::cos(theta)}, 400.0f};
    const float found = radiance_of(at, rings.transferred(0, harmonics_of_sg(light))).x;
    lowest = std::fmin(lowest, found);
    largest = std::fmax(largest, found);
  }
  EXPECT_LT(lowest, -0.05f * largest);  // where the truth is zero or more
}

TEST(SegmentTransfer, RefusesMoreSegmentsThanItKeeps) {
  fabric::Tile tile = test::empty_tile(10, 10);
  std::vector<glm::vec3> points;
  for (std::size_t i = 0; i <= SegmentTransfer::kMostSegments + 1; ++i) {
    points.push_back(
        {10.0f * static_cast<float>(i) / (SegmentTransfer::kMostSegments + 1.0f), 5, 0});
  }
  test::add_strand(tile, points, 0.001f, 1, 0);
  test::finish(tile);
  const Fabric fabric(std::move(tile), {shading::FibreBcsdf(shading::FibreMaterial{})});
  PrtSettings settings;
  settings.sh_order = 0;
  settings.paths = 1;
  SegmentTransfer transfer(fabric, settings);
  const shading::ShVector light = shading::sh_evaluate({0, 0, 1});
  for (std::uint32_t k = 0; k < SegmentTransfer::kMostSegments; ++k) {
    (void)transfer.transferred(k, light);
  }
  EXPECT_THROW((void)transfer.transferred(SegmentTransfer::kMostSegments, light), core::Error);
  (void)transfer.transferred(0, light);  // what it has, it has
}

}  // namespace
}  // namespace weft::render
