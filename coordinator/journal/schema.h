#pragma once

#include "coordinator/journal/sqlite.h"

namespace weft::coordinator {

// Makes the journal's tables in a new file, or brings those of an older schema up to date. Throws
// core::Error(kFailedPrecondition) when a newer program wrote the file.
// REQUIRES: a transaction is open, so that a file is of one schema or of the other.
void make_schema(Connection& connection);

}  // namespace weft::coordinator
