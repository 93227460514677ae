#pragma once

#include <map>
#include <string>

namespace weft::coordinator {

// How much work users, and the jobs of each, were given: start-time fair queuing (Goyal, Vin and
// Cheng 1996) on two levels, in milliseconds of one thread. Whoever was given least is next, so
// nobody with something to run waits for ever. Who had nothing to run for a while comes back at
// the level of those who had: an idle time is neither saved up nor held against anybody.
class FairShare {
 public:
  // The job has something to run now, and had nothing before.
  void arrive(const std::string& user, const std::string& job);
  // The job was chosen and given work.
  void charge(const std::string& user, const std::string& job, double thread_ms);
  // What it was given turned out to be more (or, negative, less) work.
  void correct(const std::string& user, const std::string& job, double thread_ms);
  void forget(const std::string& user, const std::string& job);

  [[nodiscard]] double of_user(const std::string& user) const;
  [[nodiscard]] double of_job(const std::string& user, const std::string& job) const;

 private:
  struct User {
    double served = 0;
    double level = 0;  // at which its jobs are served
    std::map<std::string, double> jobs;
  };

  double level_ = 0;  // at which users are served
  std::map<std::string, User> users_;
};

}  // namespace weft::coordinator
