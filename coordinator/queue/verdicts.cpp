#include "coordinator/queue/verdicts.h"

#include <algorithm>

namespace weft::coordinator {

namespace {

constexpr std::uint32_t kFewestFailures = 3;
constexpr std::size_t kFewestWitnesses = 2;

std::vector<std::string> names_of(const ShardTrouble& trouble) {
  std::set<std::string> names;
  for (const auto& [name, count] : trouble.failures) {
    names.insert(name);
  }
  for (const LoneLoss& loss : trouble.lone_losses) {
    names.insert(loss.worker);
  }
  return {names.begin(), names.end()};
}

std::string counted(std::uint64_t count, const char* what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

}  // namespace

std::uint32_t ShardTrouble::failure_count() const {
  std::uint32_t count = 0;
  for (const auto& [name, failed] : failures) {
    count += failed;
  }
  return count;
}

bool ShardTrouble::forgive(const std::string& worker) {
  for (auto it = messages.begin(); it != messages.end();) {
    it->second.erase(worker);
    it = it->second.empty() ? messages.erase(it) : std::next(it);
  }
  return failures.erase(worker) > 0;
}

std::optional<Verdict> judge_failures(const ShardTrouble& trouble,
                                      const std::set<std::string>& eligible,
                                      const QueueSettings& settings) {
  const std::uint32_t count = trouble.failure_count();
  if (count == 0) {
    return std::nullopt;
  }
  // The error that most workers gave; of several such, the last one if it is among them.
  const auto last = trouble.messages.find(trouble.last_message);
  auto worst = last == trouble.messages.end() ? trouble.messages.begin() : last;
  for (auto it = trouble.messages.begin(); it != trouble.messages.end(); ++it) {
    worst = it->second.size() > worst->second.size() ? it : worst;
  }
  const auto& [message, same] = *worst;
  const std::size_t witnesses = same.size();
  const bool on_all = count >= kFewestFailures && witnesses >= kFewestWitnesses &&
                      std::includes(same.begin(), same.end(), eligible.begin(), eligible.end());
  if (count < settings.failure_limit && witnesses < settings.same_error_limit && !on_all) {
    return std::nullopt;
  }
  return Verdict{Trouble::Kind::kQuarantined,
                 "failed " + counted(count, "time") + " on " +
                     counted(trouble.failures.size(), "worker") + ": " + message,
                 names_of(trouble)};
}

std::optional<Verdict> judge_losses(const ShardTrouble& trouble,
                                    const std::map<std::string, std::size_t>& elsewhere,
                                    const QueueSettings& settings) {
  const std::size_t all = trouble.lone_losses.size();
  std::size_t confirmed = 0;
  std::size_t of_whichever = 0;
  std::map<std::string, std::size_t> outweighed = elsewhere;
  for (const LoneLoss& loss : trouble.lone_losses) {
    std::size_t& left = outweighed[loss.worker];
    if (left > 0) {
      --left;
      continue;
    }
    ++of_whichever;
    confirmed += loss.is_confirmed ? 1 : 0;
  }
  if (confirmed < settings.lonely_loss_limit && of_whichever < settings.unconfirmed_loss_limit &&
      all < settings.hopeless_loss_limit) {
    return std::nullopt;
  }
  return Verdict{Trouble::Kind::kKiller,
                 counted(all, "worker") + " were lost while they ran it alone (last: " +
                     trouble.lone_losses.back().worker +
                     "); look for crashes, or kills for lack of memory, on those workers",
                 names_of(trouble)};
}

}  // namespace weft::coordinator
