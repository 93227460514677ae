#include "cli/output_file.h"

#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include "core/error.h"

namespace weft::cli {

void check_output_file(const std::filesystem::path& path) {
  std::error_code failure;
  if (std::filesystem::is_directory(path, failure)) {
    throw core::Error(
        core::Code::kInvalidArgument,
        path.string() + " is a folder; name a file, for example " + (path / "fabric.h5").string());
  }
  const std::filesystem::path folder =
      path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  if (!std::filesystem::is_directory(folder, failure)) {
    throw core::Error(core::Code::kNotFound,
                      "there is no folder " + folder.string() + " for the output; make it first");
  }
  if (::faccessat(AT_FDCWD, folder.c_str(), W_OK | X_OK, AT_EACCESS) != 0) {
    throw core::Error(core::Code::kPermissionDenied,
                      "the folder " + folder.string() +
                          " cannot be written to; name a file in another one, or have its rights "
                          "changed");
  }
}

}  // namespace weft::cli
