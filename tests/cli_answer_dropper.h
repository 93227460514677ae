#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

// A proxy on a loopback port that passes on all that callers say, and now and then cuts a
// connection in place of passing on what is answered: the call was made, and its caller does not
// know.

namespace weft::cli {

class AnswerDropper {
 public:
  // Between callers and 127.0.0.1:PORT. About one answer in `one_in` is lost.
  AnswerDropper(const std::string& upstream, unsigned seed, unsigned one_in)
      : upstream_port_(
            static_cast<std::uint16_t>(std::stoul(upstream.substr(upstream.rfind(':') + 1)))),
        random_(seed),
        one_in_(one_in) {
    listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address = loopback(0);
    socklen_t size = sizeof(address);
    EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(listener_, 16), 0);
    EXPECT_EQ(::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    address_ = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    thread_ = std::thread([this] { run(); });
  }
  ~AnswerDropper() {
    is_over_.store(true);
    thread_.join();
    for (const Pair& pair : pairs_) {
      close(pair);
    }
    ::close(listener_);
  }
  AnswerDropper(const AnswerDropper&) = delete;
  AnswerDropper& operator=(const AnswerDropper&) = delete;
  AnswerDropper(AnswerDropper&&) = delete;
  AnswerDropper& operator=(AnswerDropper&&) = delete;

  [[nodiscard]] const std::string& address() const { return address_; }
  [[nodiscard]] int dropped() const { return dropped_.load(); }

 private:
  struct Pair {
    int caller = -1;
    int upstream = -1;
    unsigned answers = 0;
  };

  static constexpr int kPollMs = 50;
  static constexpr unsigned kGreetings = 2;  // settings of HTTP/2, in front of any answer

  static sockaddr_in loopback(std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
  }
  static void close(const Pair& pair) {
    ::close(pair.caller);
    ::close(pair.upstream);
  }
  static bool send_all(int to, const char* data, ssize_t size) {
    while (size > 0) {
      const ssize_t sent = ::send(to, data, static_cast<std::size_t>(size), MSG_NOSIGNAL);
      if (sent <= 0) {
        return false;
      }
      data += sent;
      size -= sent;
    }
    return true;
  }

  void run() {
    while (!is_over_.load()) {
      std::vector<pollfd> waiting{{listener_, POLLIN, 0}};
      for (const Pair& pair : pairs_) {
        waiting.push_back({pair.caller, POLLIN, 0});
        waiting.push_back({pair.upstream, POLLIN, 0});
      }
      if (::poll(waiting.data(), waiting.size(), kPollMs) <= 0) {
        continue;
      }
      std::vector<Pair> kept;
      for (std::size_t i = 0; i < pairs_.size(); ++i) {
        const bool lives = (waiting[1 + 2 * i].revents == 0 || pass(pairs_[i], false)) &&
                           (waiting[2 + 2 * i].revents == 0 || pass(pairs_[i], true));
        if (lives) {
          kept.push_back(pairs_[i]);
        } else {
          close(pairs_[i]);
        }
      }
      pairs_ = std::move(kept);
      if (waiting[0].revents != 0) {
        accept();
      }
    }
  }
  void accept() {
    Pair pair;
    pair.caller = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    pair.upstream = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address = loopback(upstream_port_);
    if (::connect(pair.upstream, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0) {
      pairs_.push_back(pair);
    } else {
      close(pair);
    }
  }
  // Passes on what has come; false when the connection is over, or is cut.
  bool pass(Pair& pair, bool is_answer) {
    std::array<char, 1 << 16> buffer{};
    const ssize_t size =
        ::recv(is_answer ? pair.upstream : pair.caller, buffer.data(), buffer.size(), 0);
    if (size <= 0) {
      return false;
    }
    if (is_answer && ++pair.answers > kGreetings &&
        std::uniform_int_distribution<unsigned>(1, one_in_)(random_) == 1) {
      ++dropped_;
      return false;
    }
    return send_all(is_answer ? pair.caller : pair.upstream, buffer.data(), size);
  }

  std::uint16_t upstream_port_;
  std::mt19937 random_;
  unsigned one_in_;
  int listener_ = -1;
  std::string address_;
  std::vector<Pair> pairs_;  // of the thread alone
  std::atomic<int> dropped_{0};
  std::atomic<bool> is_over_{false};
  std::thread thread_;
};

}  // namespace weft::cli
