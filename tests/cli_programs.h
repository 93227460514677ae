#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cli/child_process.h"
#include "core/file.h"

// Real processes for tests: started from build/bin, killed and reaped when the test ends however it
// does.

namespace weft::cli {

inline std::string program(const std::string& name) {
  return (std::filesystem::path(WEFT_BIN_DIR) / name).string();
}

// A folder of the test's own that goes with it.
class TestFolder {
 public:
  TestFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "weft-test-XXXXXX").string();
    EXPECT_NE(mkdtemp(name.data()), nullptr);
    path_ = name;
    // What this user fetched before must not help, and what is fetched here goes with the folder.
    setenv("XDG_CACHE_HOME", (path_ / "cache").c_str(), 1);  // NOLINT(concurrency-mt-unsafe)
    // Nor does what this user or this machine configured.
    setenv("XDG_CONFIG_HOME", (path_ / "config").c_str(), 1);  // NOLINT(concurrency-mt-unsafe)
    setenv("WEFT_SYSTEM_CONFIG", "", 1);                       // NOLINT(concurrency-mt-unsafe)
  }
  ~TestFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;
  TestFolder(TestFolder&&) = delete;
  TestFolder& operator=(TestFolder&&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::string operator/(const std::string& name) const {
    return (path_ / name).string();
  }

 private:
  std::filesystem::path path_;
};

struct Finished {
  int code = -1;
  std::string out;
  std::string err;

  [[nodiscard]] nlohmann::json json() const { return nlohmann::json::parse(out); }
};

// Runs `weft ARGUMENTS` to its end, for two minutes at most.
inline Finished run_weft(const TestFolder& folder, const std::vector<std::string>& arguments) {
  static int count = 0;
  std::vector<std::string> command{program("weft")};
  command.insert(command.end(), arguments.begin(), arguments.end());
  const std::string log = folder / ("weft-" + std::to_string(++count) + ".err");
  ChildProcess process(command, log, true);
  Finished finished;
  while (const auto line = process.read_line(120)) {
    finished.out += *line + "\n";
  }
  finished.code = process.wait(10).value_or(-1);
  finished.err = core::read_file(log);
  return finished;
}

// A description that keeps two workers busy for some seconds: examples/tiny.textproto with more
// paths.
inline std::string write_description(const TestFolder& folder, const std::string& paths_per_cell) {
  std::string text =
      core::read_file(std::filesystem::path(WEFT_SOURCE_DIR) / "examples" / "tiny.textproto");
  const std::string key = "paths_per_cell: ";
  const std::size_t at = text.find(key);
  EXPECT_NE(at, std::string::npos);
  const std::size_t end = text.find('\n', at);
  text.replace(at, end - at, key + paths_per_cell);
  const std::string path = folder / "fabric.textproto";
  core::write_file_atomically(path, text);
  return path;
}

// A coordinator on a free port, and workers of one thread, each with a log in the folder.
class TestCluster {
 public:
  TestCluster(const TestFolder& folder, const std::string& name, int workers) : folder_(folder) {
    const std::string prefix = "weft-coordinator ready at ";
    coordinator_ = std::make_unique<ChildProcess>(
        std::vector<std::string>{program("weft-coordinator"), "--listen", "127.0.0.1:0", "--state",
                                 folder / (name + "-state"), "--lease", "3"},
        folder / (name + "-coordinator.log"), true);
    const std::string line = coordinator_->read_line(20).value_or("");
    EXPECT_EQ(line.substr(0, prefix.size()), prefix);
    address_ = line.size() > prefix.size() ? line.substr(prefix.size()) : "127.0.0.1:1";
    for (int i = 0; i < workers; ++i) {
      const std::string worker = name + "-worker-" + std::to_string(i);
      workers_.push_back(std::make_unique<ChildProcess>(
          std::vector<std::string>{program("weft-worker"), "--coordinator", address_, "--name",
                                   worker, "--threads", "1", "--scratch",
                                   folder / (worker + "-scratch")},
          folder / (worker + ".log"), false));
    }
  }

  [[nodiscard]] const std::string& address() const { return address_; }
  [[nodiscard]] ChildProcess& coordinator() { return *coordinator_; }
  [[nodiscard]] ChildProcess& worker(std::size_t index) { return *workers_.at(index); }

  // `weft ARGUMENTS --coordinator ADDRESS`.
  [[nodiscard]] Finished weft(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--coordinator", address_});
    return run_weft(folder_, arguments);
  }

 private:
  const TestFolder& folder_;
  std::string address_;
  std::unique_ptr<ChildProcess> coordinator_;
  std::vector<std::unique_ptr<ChildProcess>> workers_;
};

}  // namespace weft::cli
