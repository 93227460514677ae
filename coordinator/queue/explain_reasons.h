#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "coordinator/queue/explain.h"

namespace weft::coordinator {

inline constexpr int kReasonsLimit = 64;  // of one answer

// The reasons of one answer, as they are found; the first is the one that people read first.
class Reasons {
 public:
  void add(const char* code, const std::string& text, const std::string& mend, Time until = {});
  void add(const char* code, const std::string& text, const std::string& mend,
           const StageState& stage, Time until);
  void add_of_worker(const char* code, const std::string& text, const std::string& mend,
                     const WorkerState& worker, const std::string& stage = "");
  // What keeps workers, all of them the same thing, from a stage.
  void add_obstacle(Obstacle obstacle, const std::vector<const WorkerState*>& workers,
                    const JobState& job, const StageState* stage, Time until);

  [[nodiscard]] bool empty() const { return response_.reasons().empty(); }
  [[nodiscard]] std::string first_text() const;
  [[nodiscard]] std::string first_code() const;
  [[nodiscard]] v1::ExplainResponse answer(const std::string& subject,
                                           const std::string& verdict) &&;

 private:
  v1::Reason* next();

  v1::ExplainResponse response_;
  v1::Reason spare_;  // takes what is over the limit
};

// "1 shard", "12 shards".
[[nodiscard]] std::string shards_in_words(std::uint64_t count);

// What one planned shard does, or why it waits; nothing when it only waits for its turn.
void explain_shard(const Queue& queue, const JobState& job, const StageState& stage,
                   std::uint64_t shard, Time now, Reasons& reasons);

}  // namespace weft::coordinator
