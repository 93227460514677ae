#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/server.h"
#include "core/clock.h"
#include "core/digest.h"
#include "core/file.h"
#include "fuzz/own_folder.h"
#include "fuzz/target.h"
#include "proto/weft/v1/cluster.pb.h"

namespace {

namespace coordinator = weft::coordinator;

constexpr int kInputsOfOneServer = 500;
constexpr std::chrono::milliseconds kPatience{100};

// Every method of cluster.proto, in its order.
const std::vector<const google::protobuf::MethodDescriptor*>& methods() {
  static const auto* const all = [] {
    auto* list = new std::vector<const google::protobuf::MethodDescriptor*>;
    const auto* file = weft::v1::SubmitRequest::descriptor()->file();
    for (int s = 0; s < file->service_count(); ++s) {
      for (int m = 0; m < file->service(s)->method_count(); ++m) {
        list->push_back(file->service(s)->method(m));
      }
    }
    return list;
  }();
  return *all;
}

weft::core::Digest made_up_commit(const weft::v1::FabricDescription&,
                                  const std::vector<coordinator::StageResults>&,
                                  const std::function<std::string(const weft::core::Digest&)>&,
                                  const std::filesystem::path& path) {
  weft::core::write_file_atomically(path, "a database");
  return weft::core::digest_of("a database");
}

// A whole coordinator on a Unix socket, over a folder in memory that goes with it.
class Cluster {
 public:
  Cluster() {
    folder_ = weft::fuzz::make_own_folder();
    coordinator::SchedulerOptions options;
    options.state_folder = folder_ / "state";
    options.commit = made_up_commit;
    scheduler_ =
        std::make_unique<coordinator::Scheduler>(std::move(options), weft::core::system_clock());
    server_ =
        std::make_unique<coordinator::Server>(*scheduler_, "unix:" + (folder_ / "socket").string());
    stub_ = std::make_unique<grpc::GenericStub>(
        grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials()));
  }
  ~Cluster() {
    stub_.reset();
    server_.reset();
    scheduler_.reset();
    std::filesystem::remove_all(folder_);
  }
  Cluster(const Cluster&) = delete;
  Cluster& operator=(const Cluster&) = delete;
  Cluster(Cluster&&) = delete;
  Cluster& operator=(Cluster&&) = delete;

  // Sends one request, and takes what comes for a short while.
  grpc::Status call(const std::string& path, const std::string& request) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kPatience);
    grpc::CompletionQueue queue;
    const auto stream = stub_->PrepareCall(&context, path, &queue);
    const auto done = [&queue] {
      void* tag = nullptr;
      bool ok = false;
      return queue.Next(&tag, &ok) && ok;
    };
    stream->StartCall(nullptr);
    const grpc::Slice slice(request);
    grpc::ByteBuffer buffer(&slice, 1);
    if (done()) {
      stream->WriteLast(buffer, grpc::WriteOptions(), nullptr);
      (void)done();
    }
    do {
      stream->Read(&buffer, nullptr);
    } while (done());
    grpc::Status status;
    stream->Finish(&status, nullptr);
    (void)done();
    return status;
  }

 private:
  std::filesystem::path folder_;
  std::unique_ptr<coordinator::Scheduler> scheduler_;
  std::unique_ptr<coordinator::Server> server_;
  std::unique_ptr<grpc::GenericStub> stub_;
};

Cluster& cluster() {
  spdlog::set_level(spdlog::level::off);
  static std::unique_ptr<Cluster> current;
  static int inputs = 0;
  if (inputs++ % kInputsOfOneServer == 0) {
    current.reset();
    current = std::make_unique<Cluster>();
  }
  return *current;
}

}  // namespace

// A request to a coordinator: the first byte chooses the method, the rest are the message. Whatever
// it says, the answer is one of the contract's; INTERNAL and UNKNOWN are not.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const google::protobuf::MethodDescriptor& method = *methods()[data[0] % methods().size()];
  const std::string request(weft::fuzz::text_of(data + 1, size - 1));
  const std::unique_ptr<google::protobuf::Message> parsed(
      google::protobuf::MessageFactory::generated_factory()
          ->GetPrototype(method.input_type())
          ->New());
  const bool is_message = parsed->ParseFromString(request);
  const std::string path = "/" + method.service()->full_name() + "/" + method.name();
  const grpc::Status status = cluster().call(path, request);
  if (is_message && (status.error_code() == grpc::StatusCode::INTERNAL ||
                     status.error_code() == grpc::StatusCode::UNKNOWN)) {
    std::fprintf(stderr, "%s answers %d: %s\n%s\n", path.c_str(), status.error_code(),
                 status.error_message().c_str(), parsed->ShortDebugString().c_str());
    std::abort();
  }
  return 0;
}
