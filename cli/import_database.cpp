#include "cli/import_database.h"

#include <fstream>
#include <system_error>

#include <unistd.h>

#include "cli/fabric_reference.h"
#include "core/error.h"
#include "core/file.h"
#include "core/folder.h"
#include "core/input_file.h"
#include "storage/fabric_database.h"

namespace weft::cli {

namespace {

// The copy that is checked; removed unless it got its name.
class Copy {
 public:
  Copy(const std::filesystem::path& from, std::filesystem::path path) : path_(std::move(path)) {
    constexpr std::size_t kStepBytes = std::size_t{1} << 20;
    const core::InputFile file(from);
    std::ofstream out(path_, std::ios::binary | std::ios::trunc);
    while (out && size_bytes_ < file.size_bytes()) {
      const std::string step = file.read(size_bytes_, kStepBytes);
      if (step.empty()) {
        break;  // it became shorter; the check will say so
      }
      out.write(step.data(), static_cast<std::streamsize>(step.size()));
      size_bytes_ += step.size();
    }
    out.close();
    if (!out) {
      remove();
      throw core::Error(core::Code::kUnavailable, "cannot write " + path_.string() +
                                                      "; make room, or name another place with -o");
    }
  }
  ~Copy() { remove(); }
  Copy(const Copy&) = delete;
  Copy& operator=(const Copy&) = delete;
  Copy(Copy&&) = delete;
  Copy& operator=(Copy&&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::uint64_t size_bytes() const { return size_bytes_; }

 private:
  void remove() {
    std::error_code ignored;  // renamed already
    std::filesystem::remove(path_, ignored);
  }

  std::filesystem::path path_;
  std::uint64_t size_bytes_ = 0;
};

std::filesystem::path folder_in_cache() {
  std::filesystem::path folder = fabric_cache_folder();
  core::make_folder(folder, "name a file with -o instead");
  return folder;
}

}  // namespace

ImportedDatabase import_database(const std::filesystem::path& from, const std::string& output) {
  const std::string beside = output.empty() ? (folder_in_cache() / "import").string() : output;
  const Copy copy(from, beside + "." + std::to_string(::getpid()) + ".part");
  ImportedDatabase imported;
  imported.size_bytes = copy.size_bytes();
  try {
    imported.digest = storage::verify_database(copy.path());
  } catch (const core::Error& error) {
    std::string what = error.what();
    const std::string copied = copy.path().string();
    for (std::size_t at = what.find(copied); at != std::string::npos; at = what.find(copied)) {
      what.replace(at, copied.size(), from.string());
    }
    throw core::Error(error.code(), what);
  }
  imported.path = output.empty() ? folder_in_cache() / (imported.digest.hex() + ".h5")
                                 : std::filesystem::path(output);
  core::publish_file(copy.path(), imported.path);
  return imported;
}

}  // namespace weft::cli
