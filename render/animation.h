#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/mistakes.h"
#include "proto/weft/v1/scene.pb.h"

namespace weft::render {

inline constexpr std::uint32_t kFrameLimit = 10'000;

// The numbers of the frames that the scene is drawn at; one frame 0 without an animation.
[[nodiscard]] std::vector<std::uint32_t> frame_numbers(const v1::Scene& scene);

// The scene as it is at a frame: no animation is left in it. REQUIRES: a checked scene.
[[nodiscard]] v1::Scene scene_at_frame(const v1::Scene& scene, std::uint32_t frame);

// `text` with the number of the frame in the place of %d or %04d; as it is when it has none.
[[nodiscard]] std::string with_frame_number(const std::string& text, std::uint32_t frame);

// Whether `text` has a place for the number of a frame: exactly one %d, or %0Nd with N of 1 to 9.
[[nodiscard]] bool names_frames(const std::string& text);

// What is wrong with scene.animation, at paths that begin with "animation".
[[nodiscard]] core::Mistakes check_animation(const v1::Scene& scene);

// The files that the scene names, of all its frames, each once.
[[nodiscard]] std::vector<std::string> files_of(const v1::Scene& scene);

// The fabrics that the scene names, each once; an empty name is one of them.
[[nodiscard]] std::vector<std::string> fabrics_of(const v1::Scene& scene);

}  // namespace weft::render
