#pragma once

#include <array>
#include <atomic>
#include <cerrno>
#include <string>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace weft::cli {

// A line to a server at 127.0.0.1 that brings so many bytes of its answers and then nothing more,
// without being closed.
class StallingProxy {
 public:
  StallingProxy(int server_port, std::int64_t answer_bytes)
      : server_port_(server_port), left_bytes_(answer_bytes) {
    listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address = loopback(0);
    EXPECT_EQ(::bind(listener_, generic(address), sizeof(address)), 0);
    EXPECT_EQ(::listen(listener_, 8), 0);
    socklen_t size = sizeof(address);
    EXPECT_EQ(::getsockname(listener_, generic(address), &size), 0);
    port_ = ntohs(address.sin_port);
    acceptor_ = std::thread([this] { accept_all(); });
  }
  ~StallingProxy() {
    is_over_ = true;
    acceptor_.join();
    for (std::thread& pump : pumps_) {
      pump.join();
    }
    ::close(listener_);
  }
  StallingProxy(const StallingProxy&) = delete;
  StallingProxy& operator=(const StallingProxy&) = delete;
  StallingProxy(StallingProxy&&) = delete;
  StallingProxy& operator=(StallingProxy&&) = delete;

  [[nodiscard]] std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  // Whether somebody has asked something.
  [[nodiscard]] bool was_asked() const { return was_asked_; }

 private:
  static constexpr int kLookEveryMs = 20;

  static sockaddr_in loopback(int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    return address;
  }
  static sockaddr* generic(sockaddr_in& address) { return reinterpret_cast<sockaddr*>(&address); }

  void accept_all() {
    while (!is_over_) {
      pollfd look{listener_, POLLIN, 0};
      if (::poll(&look, 1, kLookEveryMs) > 0) {
        const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
        pumps_.emplace_back([this, client] { pump(client); });
      }
    }
  }

  void pump(int client) {
    const int server = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address = loopback(server_port_);
    bool is_open = ::connect(server, generic(address), sizeof(address)) == 0;
    while (is_open && !is_over_) {
      std::array<pollfd, 2> looks{pollfd{client, POLLIN, 0}, pollfd{server, POLLIN, 0}};
      const nfds_t count = left_bytes_ > 0 ? 2 : 1;  // what the server says is left lying there
      if (::poll(looks.data(), count, kLookEveryMs) <= 0) {
        continue;
      }
      if (looks[0].revents != 0) {
        was_asked_ = true;
        is_open = pass_on(client, server) > 0;
      }
      if (count == 2 && looks[1].revents != 0) {
        const ssize_t passed = pass_on(server, client);
        left_bytes_ -= passed;
        is_open = is_open && passed > 0;
      }
    }
    ::close(server);
    ::close(client);
  }

  static ssize_t pass_on(int from, int to) {
    std::array<char, 16384> bytes{};
    const ssize_t come = ::recv(from, bytes.data(), bytes.size(), 0);
    for (ssize_t sent = 0; sent < come;) {
      const ssize_t n =
          ::send(to, bytes.data() + sent, static_cast<std::size_t>(come - sent), MSG_NOSIGNAL);
      if (n <= 0) {
        return -1;
      }
      sent += n;
    }
    return come;
  }

  int server_port_;
  std::atomic<std::int64_t> left_bytes_;
  int listener_ = -1;
  int port_ = 0;
  std::atomic<bool> was_asked_ = false;
  std::atomic<bool> is_over_ = false;
  std::vector<std::thread> pumps_;
  std::thread acceptor_;
};

}  // namespace weft::cli
