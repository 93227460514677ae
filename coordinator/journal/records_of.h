#pragma once

#include <vector>

#include "coordinator/journal/journal.h"
#include "coordinator/queue/events.h"

namespace weft::coordinator {

// What an event's actions ask the journal to keep, in the order in which it is to be applied. Ends
// of jobs are not among it: their records hold a summary that only the scheduler can write, and
// come last. Pure, so that the simulation keeps exactly what the scheduler keeps.
[[nodiscard]] std::vector<Record> records_of(const Actions& actions);

}  // namespace weft::coordinator
