#include "storage/database_parser.h"

#include <set>

#include "core/error.h"
#include "storage/database_contents.h"
#include "storage/database_schema.h"
#include "storage/flat_database.h"
#include "storage/h5_reader.h"
#include "storage/user_block.h"

namespace weft::storage {

namespace {

template <class Specs>
std::set<std::string> paths_of(const Specs& specs) {
  std::set<std::string> paths;
  for (const auto& spec : specs) {
    paths.insert(spec.path);
  }
  return paths;
}

// A file of which every object is one of the schema's.
class SchemaReader : public h5::Reader {
 public:
  SchemaReader(std::span<const std::byte> file, h5::Decoding decoding)
      : h5::Reader(file, kUserBlockBytes, decoding) {
    require_only(paths_of(group_specs()), paths_of(dataset_specs()));
  }
};

}  // namespace

core::SandboxHandler database_handler() {
  return {[] { const h5::Session awake; },
          [](std::span<const std::byte> file, const std::vector<std::string>& arguments,
             core::FlatWriter& answer) {
            const bool wants_arrays = arguments.empty() || arguments.front() != kShapesRequest;
            SchemaReader reader(file, h5::Decoding::kInThisThread);
            flatten_database(reader, wants_arrays ? Flattened::kArrays : Flattened::kShapes,
                             answer);
          }};
}

ParsedDatabase parse_database_here(std::string_view file, const std::string& name) {
  const UserBlock block = parse_user_block(file.substr(0, kUserBlockBytes), file.size(), name);
  if (core::digest_of(file.substr(kUserBlockBytes)) != block.digest) {
    throw core::Error(core::Code::kDataLoss, name + " does not have the digest it states");
  }
  SchemaReader reader(std::as_bytes(std::span(file)), h5::Decoding::kByAllThreads);
  return {block.digest, read_contents(reader)};
}

}  // namespace weft::storage
