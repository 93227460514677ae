#pragma once

namespace weft::security {

// What gRPC has to say (of a handshake that failed, mostly) becomes a line of this program's log, a
// warning. Called once, after the log is set up.
void log_what_grpc_says();

// For commands that people use: what goes wrong is in the call's status, and gRPC says nothing.
void silence_grpc();

}  // namespace weft::security
