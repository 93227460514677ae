#pragma once

#include <string>

#include "cli/client.h"
#include "cli/interruption.h"

namespace weft::cli {

// How many signals follow_job() takes for itself.
inline constexpr int kFollowInterrupts = 2;

// Shows a job's progress on stderr until it has ended, and returns it as it then is. A coordinator
// that goes away is waited for up to a minute. At the first Ctrl-C it says how to come back to the
// job, which goes on, and waits a moment for the second, which cancels the job; SIGTERM leaves at
// once. Throws core::Error: kNotFound for an unknown job, kUnavailable when the coordinator stays
// away, kCancelled when it was interrupted. REQUIRES: `interruption` takes kFollowInterrupts.
[[nodiscard]] v1::Job follow_job(Client& client, const std::string& job_id,
                                 Interruption& interruption);

// Throws core::Error unless the job succeeded; the message says why it did not.
void throw_unless_succeeded(const v1::Job& job);

}  // namespace weft::cli
