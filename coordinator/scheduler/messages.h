#pragma once

#include <functional>
#include <vector>

#include "coordinator/journal/journal.h"
#include "coordinator/queue/queue.h"
#include "proto/weft/v1/cluster.pb.h"
#include "security/caller.h"

// Between the messages of cluster.proto and the coordinator's own types. What comes from outside is
// checked against the limits that cluster.proto states: core::Error(kInvalidArgument).

namespace weft::coordinator {

[[nodiscard]] core::Digest digest_from(const std::string& bytes, const char* field);
// Whether `id` is 1 to 64 characters of [A-Za-z0-9_-].
void check_id(const std::string& id, const char* field);

void check_priority(std::int32_t priority);
// What a submission asks of the scheduler. Throws core::Error(kPermissionDenied) when it is for
// another user and the caller is not an admin.
[[nodiscard]] JobDemands demands_from(const v1::SubmitOptions& options,
                                      const security::Caller& caller);

[[nodiscard]] ReportEvent report_from(const v1::SynchronizeRequest& request);

[[nodiscard]] v1::Version message_of(const VersionRecord& version);
[[nodiscard]] v1::HistoryEntry message_of(const HistoryRecord& step);
// The job as people see it; comment, version and the like are the caller's.
[[nodiscard]] v1::Job message_of(const Queue& queue, const JobState& job, Time now);
[[nodiscard]] v1::AttemptInfo message_of(const KeptAttempt& attempt);
// The workers for which `is_wanted` says so, by id, with what they run.
[[nodiscard]] std::vector<v1::Worker> messages_of_workers(
    const Queue& queue, Time now, const std::function<bool(const WorkerState&)>& is_wanted);

[[nodiscard]] std::int64_t to_ms(Time time);

}  // namespace weft::coordinator
