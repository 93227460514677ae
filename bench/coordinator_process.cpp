#include "bench/coordinator_process.h"

#include <fstream>
#include <sstream>

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"

namespace weft::bench {

void CoordinatorProcess::start() {
  int pipes[2];
  if (::pipe(pipes) != 0) {
    throw core::Error(core::Code::kUnavailable, "no pipe");
  }
  process_ = ::fork();
  if (process_ == 0) {
    ::dup2(pipes[1], STDOUT_FILENO);
    ::execl(program_.c_str(), program_.c_str(), "--listen", "127.0.0.1:0", "--state",
            state_.c_str(), "--log-level", "error", nullptr);
    ::_exit(127);
  }
  ::close(pipes[1]);
  std::string line;
  for (char c = 0; ::read(pipes[0], &c, 1) == 1 && c != '\n';) {
    line += c;
  }
  ::close(pipes[0]);
  if (line.find(" at ") == std::string::npos) {
    throw core::Error(core::Code::kUnavailable, program_.string() + " does not start");
  }
  address_ = line.substr(line.find(" at ") + 4);
}

void CoordinatorProcess::kill() {
  if (process_ > 0) {
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
    process_ = 0;
  }
}

std::shared_ptr<grpc::Channel> CoordinatorProcess::connect(int number) const {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);  // a connection of its own
  arguments.SetInt("weft.number", number);
  return grpc::CreateCustomChannel(address_, grpc::InsecureChannelCredentials(), arguments);
}

double CoordinatorProcess::cpu_seconds() const {
  const std::string stat = read("stat");
  std::istringstream fields(stat.substr(stat.rfind(')') + 2));
  std::string skipped;
  for (int i = 0; i < 11; ++i) {
    fields >> skipped;
  }
  double user = 0;
  double system = 0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

std::string CoordinatorProcess::read(const char* name) const {
  std::ostringstream out;
  out << std::ifstream("/proc/" + std::to_string(process_) + "/" + name).rdbuf();
  return out.str();
}

double CoordinatorProcess::number_after(const std::string& key) const {
  const std::string status = read("status");
  return std::stod(status.substr(status.find(key) + key.size()));
}

}  // namespace weft::bench
