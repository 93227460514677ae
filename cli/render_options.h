#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "proto/weft/v1/scene.pb.h"
#include "security/endpoint.h"

namespace weft::cli {

// What a person may say to `weft render`.
struct RenderOptions {
  security::Endpoint coordinator;
  std::string fabric;
  std::string scene;
  std::string again;
  std::string node;
  std::string out;
  std::string png;
  std::string stderr_image;
  std::string integrator;
  std::string size;
  std::optional<std::string> layers;
  std::optional<std::uint32_t> samples;
  std::optional<std::uint64_t> seed;
  std::optional<std::uint32_t> max_scatterings;
  std::optional<std::uint32_t> environment_lights;
  std::optional<double> target_error;
  std::optional<float> exposure;
  std::string single_from;
  std::string multiple_from;
  std::string device = "auto";
  unsigned threads = 0;
  bool local = false;
  bool paper = false;
  bool single_only = false;
  bool multiple_only = false;
  bool floats = false;
  bool progressive = false;
  bool resume = false;
  bool wants_json = false;
};

// Declares every flag of the command; `options` must outlive it.
void add_render_options(CLI::App& command, RenderOptions& options);

// The scene as it will be drawn: the flags stand above the file (--scene, or the header of the
// picture of --again), defaults are filled in. What such a header says of the pixels' type and of
// the device goes into `options`. Throws core::Error.
[[nodiscard]] v1::Scene described_scene(RenderOptions& options);

}  // namespace weft::cli
