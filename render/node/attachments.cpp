#include "render/node/attachments.h"

#include <algorithm>
#include <set>

#include "core/digest.h"
#include "core/error.h"
#include "proto/limits.h"
#include "proto/names.h"
#include "render/animation.h"
#include "render/scene_check.h"

namespace weft::render {
namespace {

[[noreturn]] void refuse(const std::string& what) {
  throw core::Error(core::Code::kInvalidArgument, what);
}

void check_scene_of(const v1::Scene& scene) {
  const core::Mistakes mistakes = check_scene(scene);
  if (!mistakes.empty()) {
    refuse("scene." + mistakes.front().path + ": " + mistakes.front().message);
  }
  const v1::Picture& picture = scene.picture();
  if (picture.width() == 0 || picture.height() == 0 || picture.samples_per_pixel() == 0 ||
      scene.integration().integrator() == v1::INTEGRATOR_UNSPECIFIED ||
      scene.integration().seed() == 0 || scene.cloths_size() == 0 || scene.lights_size() == 0) {
    refuse(
        "scene: it leaves something to defaults; an order's scene names lights, cloth, size, "
        "samples_per_pixel, integrator and seed");
  }
}

}  // namespace

void check_order(const v1::RenderOrder& order) {
  if (!v1::is_id(order.request_id())) {
    refuse("request_id: not 1 to 64 characters of [A-Za-z0-9_-]");
  }
  if (order.attachments_size() > v1::kAttachmentsLimit) {
    throw core::Error(core::Code::kResourceExhausted,
                      "attachments: " + std::to_string(order.attachments_size()) +
                          ", and an order may have " + std::to_string(v1::kAttachmentsLimit));
  }
  std::set<std::string> names;
  std::uint64_t total_bytes = 0;
  for (const v1::Attachment& attachment : order.attachments()) {
    if (attachment.name().empty() || attachment.name().size() > v1::kFileNameLimitBytes ||
        !names.insert(attachment.name()).second) {
      refuse("attachments: a name is empty, too long, or there twice");
    }
    if (!core::Digest::from_binary(attachment.digest())) {
      refuse("attachments: the digest of " + attachment.name() + " has not 32 bytes");
    }
    total_bytes += std::min(attachment.size_bytes(), v1::kAttachmentBytesLimit + 1);
    if (total_bytes > v1::kAttachmentBytesLimit) {
      throw core::Error(core::Code::kResourceExhausted,
                        "attachments: more than " + std::to_string(v1::kAttachmentBytesLimit) +
                            " bytes together; send fewer frames in one order");
    }
  }
  check_scene_of(order.scene());
  for (const std::string& file : files_of(order.scene())) {
    if (names.count(file) == 0) {
      refuse(file + ": the scene names this file, and it is no attachment");
    }
  }
}

std::uint64_t attachment_bytes(const v1::RenderOrder& order) {
  std::uint64_t bytes = 0;
  for (const v1::Attachment& attachment : order.attachments()) {
    bytes += attachment.size_bytes();
  }
  return bytes;
}

Attachments::Attachments(const v1::RenderOrder& order,
                         const std::function<bool(std::string&)>& next_chunk) {
  std::string pending;
  const auto more = [&] {
    std::string chunk;
    if (!next_chunk(chunk)) {
      return false;
    }
    if (chunk.size() > v1::kChunkLimitBytes) {
      refuse("chunk: more than 1 MiB");
    }
    pending += chunk;
    return true;
  };
  for (const v1::Attachment& attachment : order.attachments()) {
    std::string bytes;
    bytes.reserve(attachment.size_bytes());
    while (bytes.size() < attachment.size_bytes()) {
      if (pending.empty() && !more()) {
        refuse("attachments: the stream ends within " + attachment.name());
      }
      const std::size_t count =
          std::min<std::uint64_t>(pending.size(), attachment.size_bytes() - bytes.size());
      bytes.append(pending, 0, count);
      pending.erase(0, count);
    }
    if (core::digest_of(bytes).binary() != attachment.digest()) {
      refuse("attachments: the bytes of " + attachment.name() + " are not those of its digest");
    }
    files_.emplace(attachment.name(), std::move(bytes));
  }
  if (!pending.empty() || more()) {
    refuse("attachments: more bytes come than the order lists");
  }
}

FileSource Attachments::source() const {
  return [this](const std::string& name) {
    const auto found = files_.find(name);
    if (found == files_.end()) {
      refuse(name + ": the scene names this file, and it is no attachment");
    }
    return found->second;
  };
}

}  // namespace weft::render
