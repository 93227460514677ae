#pragma once

#include <string>

#include "coordinator/scheduler/scheduler.h"
#include "proto/weft/v1/cluster.pb.h"

// What the catalogue's calls answer, for whoever asks: the gRPC services and the status page.
// Errors as cluster.proto states them for the calls.

namespace weft::coordinator {

[[nodiscard]] v1::ListFabricsResponse list_fabrics(Catalogue& catalogue);
[[nodiscard]] v1::ListVersionsResponse list_versions(Catalogue& catalogue,
                                                     const std::string& fabric);
[[nodiscard]] v1::ListHistoryResponse list_history(Catalogue& catalogue, const std::string& fabric,
                                                   std::uint32_t limit);
// Puts both files together and compares them, which takes a while.
[[nodiscard]] v1::DiffVersionsResponse diff_versions(Catalogue& catalogue, const std::string& from,
                                                     const std::string& to);

}  // namespace weft::coordinator
