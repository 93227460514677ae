#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "proto/weft/v1/render.pb.h"
#include "render/file_source.h"

namespace weft::render {

// What is wrong with an order before anything else of it is looked at: its id, its list of
// attachments, its scene. Throws core::Error(kInvalidArgument or kResourceExhausted).
void check_order(const v1::RenderOrder& order);

// Bytes of all attachments that the order lists.
[[nodiscard]] std::uint64_t attachment_bytes(const v1::RenderOrder& order);

// The files of an order, by name.
class Attachments {
 public:
  // Reads them from `next_chunk`, which gives the next chunk or false at the stream's end. Throws
  // core::Error(kInvalidArgument) when too few or too many bytes come, or they are not those of the
  // digest. REQUIRES: check_order(order).
  Attachments(const v1::RenderOrder& order, const std::function<bool(std::string&)>& next_chunk);

  // Throws core::Error(kInvalidArgument) for a name that is no attachment: nothing is ever looked
  // for elsewhere. REQUIRES: this object outlives what it returns.
  [[nodiscard]] FileSource source() const;

 private:
  std::map<std::string, std::string> files_;
};

}  // namespace weft::render
