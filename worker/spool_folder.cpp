#include "worker/spool_folder.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <map>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/clock.h"
#include "core/error.h"
#include "core/file.h"
#include "proto/limits.h"

namespace weft::worker {

namespace {

namespace fs = std::filesystem;

constexpr const char* kLockName = "lock";
constexpr const char* kMaking = ".making";        // ends the name of a folder without its lock yet
constexpr const char* kDiscarded = ".discarded";  // ... of one that is being removed
constexpr std::chrono::minutes kMakingLimit{10};
constexpr std::size_t kLengthBytes = 4;
constexpr std::size_t kChecksumBytes = 8;
constexpr std::size_t kFragmentLimitBytes = std::size_t{1} << 20;

[[noreturn]] void throw_errno(int cause, const std::string& what) {
  const bool is_full = cause == ENOSPC || cause == EDQUOT || cause == EFBIG;
  throw core::Error(is_full ? core::Code::kResourceExhausted : core::Code::kUnavailable,
                    "cannot " + what +
                        " in the scratch folder: " + std::generic_category().message(cause) +
                        (is_full ? "; make room, or name another with --scratch" : ""));
}

class Descriptor {
 public:
  Descriptor(const fs::path& path, int flags)
      : value_(::open(path.c_str(), flags | O_CLOEXEC, 0600)) {}
  ~Descriptor() {
    if (value_ >= 0) {
      ::close(value_);
    }
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  Descriptor(Descriptor&&) = delete;
  Descriptor& operator=(Descriptor&&) = delete;
  [[nodiscard]] int value() const { return value_; }
  [[nodiscard]] int release() { return std::exchange(value_, -1); }

 private:
  int value_;
};

// Writes all of it at the end of the file, or leaves the file as it was.
void append_bytes(const fs::path& path, std::string_view bytes, bool is_new) {
  const Descriptor file(path, O_WRONLY | O_CREAT | O_APPEND | (is_new ? O_TRUNC : 0));
  struct stat before {};
  if (file.value() < 0 || ::fstat(file.value(), &before) != 0) {
    throw_errno(errno, "write");
  }
  std::size_t written = 0;
  while (written < bytes.size()) {
    const ssize_t n = ::write(file.value(), bytes.data() + written, bytes.size() - written);
    if (n < 0 && errno == EINTR) {
      continue;
    }
    if (n < 0) {
      const int cause = errno;
      if (is_new) {
        ::unlink(path.c_str());
      } else if (::ftruncate(file.value(), before.st_size) != 0) {
        spdlog::warn("scratch={} event=torn error=\"{}\"", path.string(),
                     std::generic_category().message(errno));
      }
      throw_errno(cause, "write");
    }
    written += static_cast<std::size_t>(n);
  }
}

std::string framed(const v1::Completion& fragment) {
  const std::string body = fragment.SerializeAsString();
  std::string frame;
  for (std::size_t i = 0; i < kLengthBytes; ++i) {
    frame.push_back(static_cast<char>(body.size() >> (8 * i) & 0xff));
  }
  return frame + core::digest_of(body).binary().substr(0, kChecksumBytes) + body;
}

// The fragments up to the first that is torn or damaged.
v1::Completion parse_fragments(std::string_view bytes) {
  v1::Completion completion;
  while (bytes.size() >= kLengthBytes + kChecksumBytes) {
    std::size_t length = 0;
    for (std::size_t i = 0; i < kLengthBytes; ++i) {
      length |= static_cast<std::size_t>(static_cast<unsigned char>(bytes[i])) << (8 * i);
    }
    const std::string_view checksum = bytes.substr(kLengthBytes, kChecksumBytes);
    bytes.remove_prefix(kLengthBytes + kChecksumBytes);
    if (length > kFragmentLimitBytes || length > bytes.size()) {
      break;
    }
    const std::string body(bytes.substr(0, length));
    v1::Completion fragment;
    if (core::digest_of(body).binary().substr(0, kChecksumBytes) != checksum ||
        !fragment.ParseFromString(body)) {
      break;
    }
    completion.MergeFrom(fragment);
    bytes.remove_prefix(length);
  }
  return completion;
}

std::optional<std::uint64_t> number_in(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  return failure == std::errc() && end == text.data() + text.size() && !text.empty()
             ? std::optional(value)
             : std::nullopt;
}

bool lock_now(int descriptor) { return ::flock(descriptor, LOCK_EX | LOCK_NB) == 0; }

// Whether the lock is still that of the folder: it may have been removed since it was opened.
bool is_in_place(int descriptor, const fs::path& path) {
  struct stat held {};
  struct stat there {};
  return ::fstat(descriptor, &held) == 0 && ::stat(path.c_str(), &there) == 0 &&
         held.st_ino == there.st_ino && held.st_dev == there.st_dev;
}

bool is_older_than(const fs::path& path, std::chrono::minutes age) {
  std::error_code gone;
  const auto written = fs::last_write_time(path, gone);
  return !gone && std::chrono::file_clock::to_sys(written) < core::system_clock().now() - age;
}

}  // namespace

SpoolFolder SpoolFolder::make(const fs::path& root, const std::string& name) {
  const fs::path path = root / name;
  const fs::path making = path.string() + kMaking;
  std::error_code failure;
  fs::create_directories(making, failure);
  Descriptor lock(making / kLockName, O_RDWR | O_CREAT);
  if (failure || lock.value() < 0 || !lock_now(lock.value())) {
    throw core::Error(core::Code::kUnavailable,
                      "cannot make the folder " + path.string() + "; name another with --scratch");
  }
  fs::rename(making, path, failure);
  if (failure) {
    throw core::Error(core::Code::kUnavailable,
                      "cannot make the folder " + path.string() + ": " + failure.message());
  }
  return {path, lock.release()};
}

std::vector<SpoolFolder> SpoolFolder::claim_orphans(const fs::path& root) {
  std::vector<SpoolFolder> orphans;
  std::error_code gone;  // other workers claim and remove at the same time
  std::vector<fs::path> paths;
  for (const auto& item : fs::directory_iterator(root, gone)) {
    paths.push_back(item.path());
  }
  for (const fs::path& path : paths) {
    const std::string name = path.filename().string();
    if (name.ends_with(kDiscarded) ||
        (name.ends_with(kMaking) && is_older_than(path, kMakingLimit))) {
      fs::remove_all(path, gone);
      continue;
    }
    Descriptor lock(path / kLockName, O_RDWR);
    if (!name.ends_with(kMaking) && lock.value() >= 0 && lock_now(lock.value()) &&
        is_in_place(lock.value(), path / kLockName)) {
      orphans.push_back(SpoolFolder(path, lock.release()));
    }
  }
  return orphans;
}

SpoolFolder::~SpoolFolder() {
  if (lock_ >= 0) {
    ::close(lock_);
  }
}

SpoolFolder::SpoolFolder(SpoolFolder&& other) noexcept
    : path_(std::move(other.path_)), lock_(std::exchange(other.lock_, -1)) {}

fs::path SpoolFolder::attempt_path(std::uint64_t number) const {
  return path_ / fmt::format("{}.attempt", number);
}

fs::path SpoolFolder::result_path(std::uint64_t number, const Result& result) const {
  return path_ / fmt::format("{}.{}.{}", number, result.shard, result.digest.hex());
}

std::vector<SpoolFolder::Content> SpoolFolder::load() const {
  std::map<std::uint64_t, Content> contents;
  std::error_code failure;
  for (const auto& item : fs::directory_iterator(path_, failure)) {
    const std::string name = item.path().filename().string();
    const auto number = number_in(name.substr(0, name.find('.')));
    if (!number) {
      continue;
    }
    Content& content = contents[*number];
    content.number = *number;
    const std::string rest = name.substr(name.find('.') + 1);
    const std::size_t dot = rest.find('.');
    if (rest == "attempt") {
      content.completion = parse_fragments(core::read_file(item.path()));
    } else if (dot != std::string::npos) {
      const auto shard = number_in(rest.substr(0, dot));
      const auto digest = core::Digest::from_hex(rest.substr(dot + 1));
      std::error_code gone;
      const std::uint64_t size_bytes = item.file_size(gone);
      if (shard && digest && !gone && size_bytes <= v1::kBlobLimitBytes) {
        content.results.push_back({*shard, *digest, size_bytes});
      }
    }
  }
  std::vector<Content> found;
  for (auto& [number, content] : contents) {
    if (content.completion.job_id().empty()) {  // killed before it was named
      for (const Result& result : content.results) {
        remove(number, result);
      }
      remove_attempt(number);
      continue;
    }
    std::sort(content.results.begin(), content.results.end(),
              [](const Result& a, const Result& b) { return a.shard < b.shard; });
    found.push_back(std::move(content));
  }
  return found;
}

void SpoolFolder::append(std::uint64_t number, const v1::Completion& fragment) const {
  append_bytes(attempt_path(number), framed(fragment), false);
}

void SpoolFolder::remove_attempt(std::uint64_t number) const {
  std::error_code gone;
  fs::remove(attempt_path(number), gone);
}

void SpoolFolder::write(std::uint64_t number, const Result& result, std::string_view bytes) const {
  append_bytes(result_path(number, result), bytes, true);
}

std::string SpoolFolder::read(std::uint64_t number, const Result& result) const {
  std::string bytes;
  try {
    bytes = core::read_file(result_path(number, result), v1::kBlobLimitBytes);
  } catch (const core::Error& error) {
    throw core::Error(core::Code::kDataLoss, error.what());
  }
  if (core::digest_of(bytes) != result.digest) {
    throw core::Error(core::Code::kDataLoss, "a result in the scratch folder is damaged");
  }
  return bytes;
}

void SpoolFolder::remove(std::uint64_t number, const Result& result) const {
  std::error_code gone;
  fs::remove(result_path(number, result), gone);
}

void SpoolFolder::sync(std::uint64_t number, const Result& result) const {
  for (const fs::path& path : {result_path(number, result), attempt_path(number)}) {
    const Descriptor file(path, O_RDONLY);
    if (file.value() >= 0 && ::fdatasync(file.value()) != 0) {
      throw_errno(errno, "sync");
    }
  }
  const Descriptor folder(path_, O_RDONLY | O_DIRECTORY);
  if (folder.value() >= 0 && ::fsync(folder.value()) != 0) {
    throw_errno(errno, "sync");
  }
}

void SpoolFolder::discard() {
  std::error_code gone;
  const fs::path discarded = path_.string() + kDiscarded;
  fs::rename(path_, discarded, gone);
  fs::remove_all(gone ? path_ : discarded, gone);
  if (lock_ >= 0) {
    ::close(lock_);
    lock_ = -1;
  }
}

}  // namespace weft::worker
