#pragma once

namespace weft::security {

enum class GrpcSays {
  kToLog,    // what goes wrong (a handshake that failed, mostly) is a warning in the program's log
  kNothing,  // for commands that people use: what goes wrong is in the call's status
};

// What every program of ours sets of gRPC as a whole. Called once by main(), after the log is set
// up, before anything else of gRPC and before any thread is started.
void set_up_grpc(GrpcSays says);

}  // namespace weft::security
