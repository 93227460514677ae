#include "client/fetch_version.h"

#include <cerrno>
#include <chrono>
#include <memory>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/error.h"
#include "core/file.h"
#include "proto/names.h"
#include "storage/fabric_database.h"

namespace weft::client {

namespace {

constexpr int kTriesWithoutProgress = 5;
constexpr std::chrono::milliseconds kFirstWait{250};
// A stream slower than this is taken for one that hangs.
constexpr std::uint64_t kSlowestBytesPerSecond = 100'000;
constexpr std::chrono::seconds kStreamAllowance{60};

[[noreturn]] void throw_errno(const std::string& what, const std::filesystem::path& path) {
  throw core::Error(core::Code::kUnavailable, "cannot " + what + " " + path.string() + ": " +
                                                  std::generic_category().message(errno));
}

// The unfinished file, held by this process alone.
class PartFile {
 public:
  explicit PartFile(std::filesystem::path path) : path_(std::move(path)) {
    while (true) {
      file_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
      if (file_ < 0) {
        throw_errno("write", path_);
      }
      if (::flock(file_, LOCK_EX) != 0) {
        ::close(file_);
        throw_errno("lock", path_);
      }
      // Whoever held it before may have renamed it: then it is a finished file, not ours to touch.
      struct stat held {};
      struct stat named {};
      if (::fstat(file_, &held) == 0 && ::stat(path_.c_str(), &named) == 0 &&
          held.st_ino == named.st_ino) {
        return;
      }
      ::close(file_);
    }
  }
  ~PartFile() { ::close(file_); }
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;
  PartFile(PartFile&&) = delete;
  PartFile& operator=(PartFile&&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

  [[nodiscard]] std::uint64_t size_bytes() const {
    struct stat held {};
    if (::fstat(file_, &held) != 0) {
      throw_errno("read", path_);
    }
    return static_cast<std::uint64_t>(held.st_size);
  }

  void clear() {
    if (::ftruncate(file_, 0) != 0) {
      throw_errno("shorten", path_);
    }
  }

  void append(const std::string& data) {
    if (::lseek(file_, 0, SEEK_END) < 0) {
      throw_errno("write", path_);
    }
    std::size_t written = 0;
    while (written < data.size()) {
      const ssize_t n = ::write(file_, data.data() + written, data.size() - written);
      if (n < 0 && errno != EINTR) {
        throw_errno("write", path_);
      }
      written += n > 0 ? static_cast<std::size_t>(n) : 0;
    }
  }

 private:
  std::filesystem::path path_;
  int file_ = -1;
};

// One stream, from what is here to wherever it breaks off.
grpc::Status stream_rest(Coordinator& coordinator, const v1::Version& version, PartFile& part,
                         const FetchReport& report) {
  v1::FetchVersionRequest request;
  request.set_reference(reference_text(version));
  request.set_offset(part.size_bytes());
  grpc::ClientContext context;
  const std::uint64_t allowance = version.size_bytes() / kSlowestBytesPerSecond;
  Coordinator::set_deadline(context, kStreamAllowance + std::chrono::seconds(allowance));
  const auto reader = coordinator.catalogue().FetchVersion(&context, request);
  v1::FetchVersionResponse response;
  while (reader->Read(&response)) {
    if (part.size_bytes() + response.data().size() > version.size_bytes()) {
      context.TryCancel();
      (void)reader->Finish();
      part.clear();
      throw core::Error(core::Code::kDataLoss,
                        reference_text(version) + ": more bytes came than the version has");
    }
    part.append(response.data());
    try {
      if (report) {
        report(part.size_bytes(), version.size_bytes());
      }
    } catch (...) {
      context.TryCancel();
      (void)reader->Finish();
      throw;
    }
  }
  return reader->Finish();
}

void fetch_rest(Coordinator& coordinator, const v1::Version& version, PartFile& part,
                const FetchReport& report) {
  int tries_left = kTriesWithoutProgress;
  std::chrono::milliseconds wait = kFirstWait;
  while (part.size_bytes() < version.size_bytes()) {
    const std::uint64_t before = part.size_bytes();
    const grpc::Status status = stream_rest(coordinator, version, part, report);
    if (part.size_bytes() == version.size_bytes()) {
      return;
    }
    const bool is_worth_repeating = status.ok() ||
                                    status.error_code() == grpc::StatusCode::UNAVAILABLE ||
                                    status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
    if (part.size_bytes() > before) {
      tries_left = kTriesWithoutProgress;
      wait = kFirstWait;
    }
    if (!is_worth_repeating || --tries_left == 0) {
      coordinator.check(status, "fetch " + reference_text(version));
      throw core::Error(core::Code::kDataLoss,
                        "the coordinator's file of " + reference_text(version) + " ends too early");
    }
    std::this_thread::sleep_for(wait);
    wait *= 2;
  }
}

bool is_this_version(const std::filesystem::path& path, const v1::Version& version) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path, failure) ||
      std::filesystem::file_size(path, failure) != version.size_bytes()) {
    return false;
  }
  try {
    return storage::verify_database(path) == version_digest(version);
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kDataLoss && error.code() != core::Code::kNotFound) {
      throw;  // it could not be checked: that says nothing about the file
    }
    return false;
  }
}

}  // namespace

std::string reference_text(const v1::Version& version) {
  return version.fabric() + "@" + std::to_string(version.number());
}

v1::Version find_version(Coordinator& coordinator, const std::string& reference) {
  v1::GetVersionRequest request;
  request.set_reference(reference);
  const v1::GetVersionResponse response =
      coordinator.call(coordinator.catalogue(), &v1::CatalogueService::Stub::GetVersion, request,
                       "look up " + reference);
  // The name becomes a file's: what a coordinator says is not believed to be one.
  if (!v1::is_fabric_name(response.version().fabric())) {
    throw core::Error(core::Code::kDataLoss, "the coordinator's answer about " + reference +
                                                 " names no fabric; is it a coordinator of weft?");
  }
  return response.version();
}

core::Digest version_digest(const v1::Version& version) {
  const auto digest = core::Digest::from_binary(version.content_digest());
  if (!digest) {
    throw core::Error(
        core::Code::kDataLoss,
        "the coordinator's answer about " + reference_text(version) + " has no content digest");
  }
  return *digest;
}

FetchOutcome fetch_version(Coordinator& coordinator, const v1::Version& version,
                           const std::filesystem::path& path, const FetchReport& report) {
  const core::Digest digest = version_digest(version);
  if (is_this_version(path, version)) {
    return {true, 0};
  }
  PartFile part(path.string() + "." + digest.hex().substr(0, 16) + ".part");
  if (part.size_bytes() > version.size_bytes()) {
    part.clear();
  }
  const std::uint64_t bytes_kept = part.size_bytes();
  fetch_rest(coordinator, version, part, report);
  if (!is_this_version(part.path(), version)) {
    part.clear();
    throw core::Error(core::Code::kDataLoss,
                      "what came of " + reference_text(version) +
                          " is not what was published; it was thrown away, fetch it again");
  }
  core::publish_file(part.path(), path);
  return {false, bytes_kept};
}

}  // namespace weft::client
