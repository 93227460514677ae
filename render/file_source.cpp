#include "render/file_source.h"

#include "core/file.h"

namespace weft::render {

FileSource files_on_disk() {
  constexpr std::uint64_t kFileLimitBytes = std::uint64_t{4} << 30;
  return [](const std::string& name) { return core::read_file(name, kFileLimitBytes); };
}

}  // namespace weft::render
