#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include <grpcpp/channel.h>
#include <sys/types.h>

namespace weft::bench {

// weft-coordinator on a loopback port, in a process of its own.
class CoordinatorProcess {
 public:
  CoordinatorProcess(std::filesystem::path program, std::filesystem::path state)
      : program_(std::move(program)), state_(std::move(state)) {}
  ~CoordinatorProcess() { kill(); }
  CoordinatorProcess(const CoordinatorProcess&) = delete;
  CoordinatorProcess& operator=(const CoordinatorProcess&) = delete;
  CoordinatorProcess(CoordinatorProcess&&) = delete;
  CoordinatorProcess& operator=(CoordinatorProcess&&) = delete;

  // Returns when it says that it is ready. Throws core::Error(kUnavailable) when it does not.
  void start();
  void kill();

  [[nodiscard]] const std::string& address() const { return address_; }
  // A connection of its own for each number.
  [[nodiscard]] std::shared_ptr<grpc::Channel> connect(int number = 0) const;
  [[nodiscard]] double cpu_seconds() const;
  [[nodiscard]] double memory_bytes() const { return 1024 * number_after("VmRSS:"); }
  [[nodiscard]] double threads() const { return number_after("Threads:"); }

 private:
  [[nodiscard]] std::string read(const char* name) const;
  [[nodiscard]] double number_after(const std::string& key) const;

  std::filesystem::path program_;
  std::filesystem::path state_;
  pid_t process_ = 0;
  std::string address_;
};

}  // namespace weft::bench
