#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <spdlog/spdlog.h>
#include <unistd.h>

#include "core/digest.h"
#include "core/error.h"
#include "fuzz/own_folder.h"
#include "fuzz/target.h"
#include "worker/spool_folder.h"

namespace {

const std::filesystem::path& folder() {
  static const std::filesystem::path path = [] {
    spdlog::set_level(spdlog::level::off);
    (void)std::atexit([] { std::filesystem::remove_all(folder()); });
    return weft::fuzz::make_own_folder();
  }();
  return path;
}

// The frame of a fragment with a right length and checksum.
std::string framed(const std::string& body) {
  std::string frame;
  for (unsigned shift = 0; shift < 32; shift += 8) {
    frame += static_cast<char>(body.size() >> shift & 0xff);
  }
  return frame + weft::core::digest_of(body).binary().substr(0, 8) + body;
}

}  // namespace

// What a worker that died left on its disk: an attempt's file as it is, or when the first byte is
// odd, one fragment whose checksum is right.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const std::string bytes(weft::fuzz::text_of(data + 1, size - 1));
  try {
    weft::worker::SpoolFolder spool = weft::worker::SpoolFolder::make(folder(), "one");
    std::ofstream(spool.path() / "1.attempt", std::ios::binary)
        << (data[0] % 2 == 0 ? bytes : framed(bytes));
    for (const auto& content : spool.load()) {
      static_cast<void>(content.completion.ByteSizeLong());
    }
    spool.discard();
  } catch (const weft::core::Error&) {
  }
  return 0;
}
