#include "coordinator/queue/fairness.h"

#include <algorithm>

namespace weft::coordinator {

void FairShare::arrive(const std::string& user, const std::string& job) {
  User& account = users_[user];
  account.served = std::max(account.served, level_);
  double& served = account.jobs[job];
  served = std::max(served, account.level);
}

void FairShare::charge(const std::string& user, const std::string& job, double thread_ms) {
  User& account = users_[user];
  double& served = account.jobs[job];
  level_ = std::max(level_, account.served);
  account.level = std::max(account.level, served);
  account.served += thread_ms;
  served += thread_ms;
}

void FairShare::correct(const std::string& user, const std::string& job, double thread_ms) {
  const auto account = users_.find(user);
  if (account == users_.end()) {
    return;
  }
  account->second.served += thread_ms;
  const auto served = account->second.jobs.find(job);
  if (served != account->second.jobs.end()) {
    served->second += thread_ms;
  }
}

void FairShare::forget(const std::string& user, const std::string& job) {
  const auto account = users_.find(user);
  if (account == users_.end()) {
    return;
  }
  account->second.jobs.erase(job);
  // Who had more than the others keeps that in mind, or many small jobs would begin anew each time.
  if (account->second.jobs.empty() && account->second.served <= level_) {
    users_.erase(account);
  }
}

double FairShare::of_user(const std::string& user) const {
  const auto account = users_.find(user);
  return account == users_.end() ? level_ : account->second.served;
}

double FairShare::of_job(const std::string& user, const std::string& job) const {
  const auto account = users_.find(user);
  if (account == users_.end()) {
    return 0;
  }
  const auto served = account->second.jobs.find(job);
  return served == account->second.jobs.end() ? account->second.level : served->second;
}

}  // namespace weft::coordinator
