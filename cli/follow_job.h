#pragma once

#include <string>

#include "cli/client.h"

namespace weft::cli {

// Shows a job's progress on stderr until it has ended, and returns it as it then is. A coordinator
// that goes away is waited for up to a minute. Throws core::Error: kNotFound for an unknown job,
// kUnavailable when the coordinator stays away.
[[nodiscard]] v1::Job follow_job(Client& client, const std::string& job_id);

// Throws core::Error unless the job succeeded; the message says why it did not.
void throw_unless_succeeded(const v1::Job& job);

}  // namespace weft::cli
