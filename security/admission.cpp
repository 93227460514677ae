#include "security/admission.h"

#include <utility>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/clock.h"
#include "core/error.h"
#include "core/file.h"

namespace weft::security {

namespace {

constexpr std::size_t kCertificatesLimit = 1024;  // read ones that are remembered
constexpr std::uint64_t kListLimitBytes = 16 << 20;

}  // namespace

Admission::Admission(TlsFolder folder) : folder_(std::move(folder)) {
  const std::lock_guard lock(mutex_);
  load_list();
}

Admission::FileState Admission::state_of(const std::filesystem::path& path) {
  std::error_code failure;
  FileState state;
  state.time = std::filesystem::last_write_time(path, failure);
  state.is_there = !failure;
  state.size = state.is_there ? std::filesystem::file_size(path, failure) : 0;
  return state.is_there ? state : FileState{};
}

Admission::Verdict Admission::judge(const std::string& pem) {
  const std::lock_guard lock(mutex_);
  auto found = certificates_.find(pem);
  if (found == certificates_.end()) {
    if (certificates_.size() >= kCertificatesLimit) {
      certificates_.clear();
    }
    try {
      found = certificates_.emplace(pem, read_certificate(pem)).first;
    } catch (const core::Error&) {
      return {std::nullopt, "the call comes without a certificate that can be read"};
    }
  }
  return {found->second, problem_now(found->second)};
}

std::string Admission::problem_of(const Certificate& certificate) {
  const std::lock_guard lock(mutex_);
  return problem_now(certificate);
}

std::string Admission::problem_now(const Certificate& certificate) const {
  const auto revoked = revoked_.find(certificate.serial);
  if (revoked != revoked_.end()) {
    return fmt::format(
        "the certificate of '{}' was revoked on {}; ask whoever keeps the "
        "authority '{}' for another",
        certificate.name, date_text(revoked->second), certificate.issuer);
  }
  if (core::system_clock().now() > certificate.valid_until) {
    return fmt::format(
        "the certificate of '{}' expired on {}; ask whoever keeps the authority "
        "'{}' for another",
        certificate.name, date_text(certificate.valid_until), certificate.issuer);
  }
  return "";
}

void Admission::load_list() {
  const FileState state = state_of(folder_.revoked());
  if (state.is_there) {
    revoked_ = read_revocations(core::read_file(folder_.revoked(), kListLimitBytes),
                                core::read_file(folder_.authority(), kListLimitBytes));
  }
  list_state_ = state;
}

void Admission::refresh() {
  const std::lock_guard lock(mutex_);
  const FileState seen = state_of(folder_.revoked());
  if (seen == list_state_) {
    return;
  }
  try {
    load_list();
    spdlog::info("event=revocations_loaded file={} certificates={}", folder_.revoked().string(),
                 revoked_.size());
  } catch (const core::Error& error) {
    list_state_ = seen;
    spdlog::error("event=revocations_refused file={} message=\"{}; the last list stays in force\"",
                  folder_.revoked().string(), error.what());
  }
}

}  // namespace weft::security
