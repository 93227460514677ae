#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "proto/weft/v1/scene.pb.h"
#include "render/fabric.h"

namespace weft::bench {

// A fabric of a request: a database, or a part of one (storage/reduce.h), shaded in its own way.
struct FabricChoice {
  std::string path;
  std::optional<std::uint32_t> sh_order;
  std::optional<std::uint32_t> components;
  bool half = false;
  std::optional<float> blend_low;
  std::optional<float> blend_high;

  auto operator<=>(const FabricChoice&) const = default;
};

// One line of JSON that asks for a picture. `fabric` and `scene` (protobuf text; its files are
// looked for in `folder`) MUST be there.
struct PictureRequest {
  FabricChoice fabric;
  v1::Scene scene;  // defaults expanded
  // Draw on this device (weft render --list-devices; "auto": the best); empty: on the CPU.
  std::string device;
  std::uint32_t nearest_samples = 0;  // of the device: the paper's nearest midpoints; 0: exact
  // Samples are added until the relative standard error of the mean colour is at or below
  // target_error (0: as many samples as the scene says), or there are most_samples, or after
  // most_seconds (0: no limit).
  double target_error = 0;
  std::uint32_t most_samples = 1024;
  double most_seconds = 0;
  std::string picture;        // to write; empty: none
  std::string error_picture;  // its standard error
  std::string preview;        // PNG
  std::string against;        // picture to compare with
  std::string against_error;  // that picture's standard error
};

// Throws core::Error(kInvalidArgument) that says which part of the request is wrong.
[[nodiscard]] PictureRequest parse_request(const std::string& line);

// Fabrics, each loaded once and kept.
class FabricCache {
 public:
  // Throws core::Error.
  [[nodiscard]] std::shared_ptr<const render::Fabric> take(const FabricChoice& choice);

 private:
  std::map<FabricChoice, std::shared_ptr<const render::Fabric>> fabrics_;
};

}  // namespace weft::bench
