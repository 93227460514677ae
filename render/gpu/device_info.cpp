#include "render/gpu/device_info.h"

#include <algorithm>
#include <cctype>
#include <charconv>

#include <fmt/format.h>

#include "core/check.h"
#include "core/error.h"

namespace weft::render::gpu {

namespace {

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

const char* kind_name(DeviceInfo::Kind kind) {
  switch (kind) {
    case DeviceInfo::Kind::kDiscrete:
      return "discrete GPU";
    case DeviceInfo::Kind::kVirtual:
      return "virtual GPU";
    case DeviceInfo::Kind::kIntegrated:
      return "integrated GPU";
    case DeviceInfo::Kind::kSoftware:
      return "software";
    case DeviceInfo::Kind::kOther:
      break;
  }
  return "other";
}

std::string bytes_text(std::uint64_t bytes) {
  const auto value = static_cast<double>(bytes);
  if (bytes < 1024) {
    return fmt::format("{} bytes", bytes);
  }
  if (value < 0x1p20) {
    return fmt::format("{:.1f} KiB", value / 0x1p10);
  }
  if (value < 0x1p30) {
    return fmt::format("{:.1f} MiB", value / 0x1p20);
  }
  return fmt::format("{:.1f} GiB", value / 0x1p30);
}

const DeviceInfo& choose(const std::vector<DeviceInfo>& devices, const std::string& wanted) {
  CHECK(!devices.empty());
  if (wanted.empty() || lower(wanted) == "auto") {
    return devices.front();
  }
  std::uint32_t index = 0;
  const char* end = wanted.data() + wanted.size();
  const auto [rest, failure] = std::from_chars(wanted.data(), end, index);
  if (failure == std::errc() && rest == end) {
    if (index < devices.size()) {
      return devices[index];
    }
  } else {
    for (const DeviceInfo& info : devices) {
      if (lower(info.name).find(lower(wanted)) != std::string::npos) {
        return info;
      }
    }
  }
  std::string there;
  for (const DeviceInfo& info : devices) {
    there += fmt::format("\n  {}: {} ({})", info.index, info.name, kind_name(info.kind));
  }
  throw core::Error(core::Code::kNotFound,
                    fmt::format("no device '{}'; say the number or a part of the name of one of "
                                "these:{}",
                                wanted, there));
}

}  // namespace weft::render::gpu
