#include "core/folder.h"

#include <string>
#include <system_error>

#include "core/error.h"

namespace weft::core {

void make_folder(const std::filesystem::path& folder, std::string_view remedy) {
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure) {
    throw Error(Code::kUnavailable, "cannot make the folder " + folder.string() + ": " +
                                        failure.message() + "; " + std::string(remedy));
  }
}

}  // namespace weft::core
