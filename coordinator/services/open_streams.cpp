#include "coordinator/services/open_streams.h"

#include <utility>

#include <fmt/format.h>

#include "core/error.h"

namespace weft::coordinator {

OpenStreams::OpenStreams(std::string name, int limit, int limit_per_connection)
    : name_(std::move(name)), limit_(limit), limit_per_connection_(limit_per_connection) {}

OpenStreams::Ticket OpenStreams::enter(const grpc::ServerContextBase& context) {
  return {*this, context.peer()};
}

OpenStreams::Ticket::Ticket(OpenStreams& streams, std::string peer)
    : streams_(streams), peer_(std::move(peer)) {
  const std::lock_guard lock(streams_.mutex_);
  if (streams_.open_ >= streams_.limit_) {
    throw core::Error(core::Code::kResourceExhausted,
                      fmt::format("{}_limit: {} are open, which is the limit; try again later",
                                  streams_.name_, streams_.open_));
  }
  int& open = streams_.open_of_peer_[peer_];
  if (!peer_.starts_with("unix:") && open >= streams_.limit_per_connection_) {
    throw core::Error(core::Code::kResourceExhausted,
                      fmt::format("{}_per_connection_limit: this connection has {} open, which is "
                                  "the limit; wait for one of them",
                                  streams_.name_, open));
  }
  ++open;
  ++streams_.open_;
}

OpenStreams::Ticket::~Ticket() {
  const std::lock_guard lock(streams_.mutex_);
  --streams_.open_;
  const auto mine = streams_.open_of_peer_.find(peer_);
  if (--mine->second == 0) {
    streams_.open_of_peer_.erase(mine);
  }
}

}  // namespace weft::coordinator
