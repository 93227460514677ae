#include <algorithm>
#include <string>

#include "core/error.h"
#include "fuzz/target.h"
#include "proto/limits.h"
#include "proto/weft/v1/render.pb.h"
#include "render/animation.h"
#include "render/node/attachments.h"
#include "render/scene_description.h"

namespace {

namespace render = weft::render;

// The message of RenderService.Render, and the bytes of its files behind it.
void take_order(std::string_view bytes) {
  constexpr std::size_t kLengthBytes = 2;
  if (bytes.size() < kLengthBytes) {
    return;
  }
  const std::size_t stated = static_cast<unsigned char>(bytes[0]) +
                             std::size_t{256} * static_cast<unsigned char>(bytes[1]);
  bytes.remove_prefix(kLengthBytes);
  const std::size_t length = std::min(stated, bytes.size());
  weft::v1::RenderOrder order;
  if (!order.ParseFromString(std::string(bytes.substr(0, length)))) {
    return;
  }
  render::check_order(order);
  std::string rest(bytes.substr(length));
  const render::Attachments attachments(order, [&rest](std::string& chunk) {
    chunk = rest;
    rest.clear();
    return !chunk.empty();
  });
  for (const std::string& file : render::files_of(order.scene())) {
    static_cast<void>(attachments.source()(file));
  }
}

}  // namespace

// What a render node is asked for, or when the first byte is odd, a scene that somebody wrote.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const std::string_view bytes = weft::fuzz::text_of(data + 1, size - 1);
  try {
    if (data[0] % 2 == 0) {
      take_order(bytes);
    } else {
      static_cast<void>(render::parse_scene(bytes, "fuzz", "/absent/folder"));
    }
  } catch (const weft::core::Error&) {
  }
  return 0;
}
