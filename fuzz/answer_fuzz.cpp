#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "core/error.h"
#include "fuzz/target.h"
#include "render/files/exr_parser.h"
#include "render/files/obj_parser.h"
#include "render/files/png_parser.h"
#include "storage/database_contents.h"
#include "storage/database_fields.h"
#include "storage/flat_database.h"

namespace {

namespace render = weft::render;
namespace storage = weft::storage;

void take(std::uint8_t kind, std::span<const std::byte> answer) {
  switch (kind % 5) {
    case 0: {
      storage::FlatDatabase source(answer, storage::Flattened::kArrays);
      storage::check_values(storage::read_contents(source));
      break;
    }
    case 1:
      static_cast<void>(storage::FlatDatabase(answer, storage::Flattened::kShapes));
      break;
    case 2:
      static_cast<void>(render::image_from(weft::core::FlatReader(answer)));
      break;
    case 3:
      static_cast<void>(render::mesh_from(weft::core::FlatReader(answer)));
      break;
    default:
      static_cast<void>(render::plain_picture_from(weft::core::FlatReader(answer), 4096));
  }
}

}  // namespace

// What a sandbox that was taken over hands back: the first byte says as what it is taken. This is
// the border that the sandbox draws, so nothing here may go wrong in any way.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  std::vector<std::uint64_t> aligned(size / sizeof(std::uint64_t) + 1);
  std::memcpy(aligned.data(), data + 1, size - 1);
  try {
    take(data[0], std::as_bytes(std::span(aligned)).first(size - 1));
  } catch (const weft::core::Error&) {
  }
  return 0;
}
