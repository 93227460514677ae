#include "cli/list_devices.h"

#include <string>
#include <vector>

#include <fmt/format.h>

#include "cli/print_json.h"
#include "cli/table.h"
#include "render/gpu/device_info.h"

namespace weft::cli {

namespace gpu = render::gpu;

void list_devices(bool wants_json) {
  const std::vector<gpu::DeviceInfo> devices = gpu::list_devices();
  if (wants_json) {
    nlohmann::json list = nlohmann::json::array();
    for (const gpu::DeviceInfo& info : devices) {
      list.push_back({{"index", info.index},
                      {"name", info.name},
                      {"driver", info.driver},
                      {"kind", gpu::kind_name(info.kind)},
                      {"memory_bytes", info.memory_bytes},
                      {"max_buffer_bytes", info.max_buffer_bytes}});
    }
    print_json({{"devices", list}});
    return;
  }
  Table table({"DEVICE", "KIND", "MEMORY", "LARGEST BUFFER", "DRIVER", "NAME"});
  for (const gpu::DeviceInfo& info : devices) {
    table.add({std::to_string(info.index), gpu::kind_name(info.kind),
               gpu::bytes_text(info.memory_bytes), gpu::bytes_text(info.max_buffer_bytes),
               info.driver, info.name});
  }
  fmt::print("{}", table.text());
  if (devices.front().kind == gpu::DeviceInfo::Kind::kSoftware) {
    fmt::print(stderr,
               "no GPU: unless --device names one of these, the CPU draws, which is faster\n");
  }
}

}  // namespace weft::cli
