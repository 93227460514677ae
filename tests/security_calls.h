#pragma once

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include <google/protobuf/descriptor.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>
#include <gtest/gtest.h>

#include "core/clock.h"
#include "proto/weft/v1/cluster.pb.h"
#include "proto/weft/v1/render.pb.h"
#include "security/authority.h"
#include "security/channel.h"

// Certificates for tests, and calls of every kind that a descriptor names.

namespace weft::security {

// An authority in a folder that goes with it, and what it issues beside it.
class TestAuthority {
 public:
  TestAuthority() : folder_(make_folder()) {
    Authority::make(folder_ / "authority", "weft", std::chrono::days(30), now());
  }
  ~TestAuthority() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  TestAuthority(const TestAuthority&) = delete;
  TestAuthority& operator=(const TestAuthority&) = delete;
  TestAuthority(TestAuthority&&) = delete;
  TestAuthority& operator=(TestAuthority&&) = delete;

  [[nodiscard]] static core::Clock::Time now() { return core::system_clock().now(); }
  [[nodiscard]] Authority authority() const { return Authority(folder_ / "authority"); }
  [[nodiscard]] std::filesystem::path folder_of(const std::string& name) const {
    return folder_ / name;
  }
  // Returns the folder.
  std::string issue(const std::string& name, const std::vector<v1::Role>& roles,
                    const std::vector<std::string>& hosts = {},
                    core::Clock::Time when = now()) const {
    return authority()
        .issue(name, roles, hosts, std::chrono::days(10), folder_of(name), when)
        .folder.string();
  }

 private:
  static std::filesystem::path make_folder() {
    std::string name = (std::filesystem::temp_directory_path() / "weft-certs-XXXXXX").string();
    EXPECT_NE(mkdtemp(name.data()), nullptr);
    return name;
  }

  std::filesystem::path folder_;
};

// "/weft.v1.JobService/Submit", ... of every method of a file.
inline std::vector<std::string> paths_of(const google::protobuf::FileDescriptor& file) {
  std::vector<std::string> paths;
  for (int s = 0; s < file.service_count(); ++s) {
    for (int m = 0; m < file.service(s)->method_count(); ++m) {
      paths.push_back("/" + file.service(s)->full_name() + "/" +
                      file.service(s)->method(m)->name());
    }
  }
  return paths;
}

// A call of any method with one empty message, which every method can read.
class AnyCall : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  AnyCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& path,
          std::chrono::milliseconds deadline)
      : stub_(channel) {
    const gpr_timespec after = gpr_time_from_millis(deadline.count(), GPR_TIMESPAN);
    context_.set_deadline(gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), after));
    stub_.PrepareBidiStreamingCall(&context_, path, {}, this);
    StartWriteLast(&request_, grpc::WriteOptions());
    StartRead(&response_);
    StartCall();
  }
  // Ends the call when it has not ended.
  ~AnyCall() override {
    context_.TryCancel();
    (void)wait();
  }
  AnyCall(const AnyCall&) = delete;
  AnyCall& operator=(const AnyCall&) = delete;
  AnyCall(AnyCall&&) = delete;
  AnyCall& operator=(AnyCall&&) = delete;

  [[nodiscard]] grpc::Status wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return is_done_; });
    return status_;
  }
  [[nodiscard]] bool is_done() {
    const std::lock_guard lock(mutex_);
    return is_done_;
  }
  // Returns when a message came, or the call ended.
  [[nodiscard]] bool wait_for_answer() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return is_done_ || answers_ > 0; });
    return answers_ > 0;
  }

  // Returns when the last message is this one, or the call ended: whether it is.
  [[nodiscard]] bool wait_for_answer(const std::string& bytes) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return is_done_ || answer_ == bytes; });
    return answer_ == bytes;
  }

  // The bytes of the message that came last.
  [[nodiscard]] std::string answer() {
    const std::lock_guard lock(mutex_);
    return answer_;
  }

  void OnReadDone(bool has_read) override {
    if (has_read) {
      {
        const std::lock_guard lock(mutex_);
        ++answers_;
        std::vector<grpc::Slice> slices;
        (void)response_.Dump(&slices);
        answer_.clear();
        for (const grpc::Slice& slice : slices) {
          answer_.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
        }
      }
      changed_.notify_all();
      StartRead(&response_);
    }
  }
  void OnDone(const grpc::Status& status) override {
    {
      const std::lock_guard lock(mutex_);
      status_ = status;
      is_done_ = true;
      changed_.notify_all();
    }
  }

 private:
  grpc::GenericStub stub_;
  grpc::ClientContext context_;
  grpc::Slice nothing_;
  grpc::ByteBuffer request_{&nothing_, 1};
  grpc::ByteBuffer response_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_done_ = false;
  int answers_ = 0;
  std::string answer_;
  grpc::Status status_;
};

inline grpc::Status call(const std::shared_ptr<grpc::Channel>& channel, const std::string& path,
                         std::chrono::milliseconds deadline = std::chrono::seconds(10)) {
  return AnyCall(channel, path, deadline).wait();
}

}  // namespace weft::security
