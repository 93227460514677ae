// Writes the seeds of fuzz/corpus: fuzz_make_seeds SOURCE_DIR FOLDER. Inputs that once crashed
// something are put beside them by hand and stay.

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include "coordinator/scheduler/scheduler.h"
#include "core/clock.h"
#include "core/file.h"
#include "core/flat.h"
#include "core/sandbox.h"
#include "fabric/description.h"
#include "proto/weft/v1/cluster.pb.h"
#include "proto/weft/v1/render.pb.h"
#include "render/animation.h"
#include "render/files/exr_parser.h"
#include "render/files/obj_parser.h"
#include "render/image.h"
#include "render/png.h"
#include "render/scene_description.h"
#include "storage/database_parser.h"
#include "tests/storage_test_database.h"

namespace {

namespace core = weft::core;
namespace v1 = weft::v1;
using google::protobuf::FieldDescriptor;

std::filesystem::path source;
std::filesystem::path corpus;

void put(const std::string& target, const std::string& name, const std::string& bytes) {
  std::filesystem::create_directories(corpus / target);
  core::write_file_atomically(corpus / target / name, bytes);
}

std::string small_wif() {
  return "[WIF]\nVersion=1.1\nSource Program=none\n[CONTENTS]\nCOLOR PALETTE=true\n"
         "[COLOR PALETTE]\nEntries=2\nRange=0,255\n[COLOR TABLE]\n1=255,255,255\n2=10,20,200\n"
         "[WEAVING]\nShafts=4\nTreadles=4\nRising Shed=true\n"
         "[WARP]\nThreads=4\nUnits=centimeters\nSpacing=0.05\nThickness=0.04\nColor=1\n"
         "[WEFT]\nThreads=4\nSpacing=0.05\nColor=2\n"
         "[THREADING]\n1=1\n2=2\n3=3\n4=4\n[TIEUP]\n1=1,2\n2=2,3\n3=3,4\n4=4,1\n"
         "[TREADLING]\n1=1\n2=2\n3=3\n4=4\n[WARP COLORS]\n1=1\n2=2\n[WEFT SPACING]\n1=0.06\n";
}

std::string small_dtx() {
  return "@@StartDTX\n%%version 1\n\n@@Description\ntwill\n\n@@Contents\nInfo\n\n"
         "@@Info\n%%shafts 4 \n%%treadles 4\n%%ends 4\n%%picks 4\n\n@@Threading\n1 2 3 4\n\n"
         "@@Tieup\n%%sinking\n0011\n0110\n1100\n1001\n\n@@Treadling\n%%compound\n1 2, 3 3 4\n\n"
         "@@Color Palet\n255,255,255\n10,20,200\n\n@@Warp Colors\n0 0 1 1\n\n"
         "@@Weft Spacing\n4 4 2 4\n\n@@EndDTX\n";
}

// A twill of one treadle a pick (fabric/wpo.h has the layout).
std::string small_wpo() {
  std::string bytes = {123, 7, 101, 4, 4, 4, 0, 0, 0, 20, 20, 0, 0, 0, 4, 0, 4};
  bytes.append(7, '\0');
  bytes += {0, 4, 1, 2, 3, 4, 0, 4, 0, 0, 1, 1, 0, 4, 1, 1, 1, 1};
  bytes += {3, 6, 12, 9};
  bytes += {0, 4, 1, 2, 3, 4};
  bytes.append(66, '\0');
  bytes += {2, '\xff', '\xff', '\xff', 10, 20, '\xc8'};
  return bytes;
}

// A yarn that goes on in the next tile, and a ring.
std::string small_bcc() {
  std::string bytes = {'B', 'C', 'C', 0x44, 'C', '0', 3, 2, 2, 0, 0, 0, 0, 0, 0, 0, 6};
  bytes.append(7 + 40, '\0');
  const auto add = [&bytes](std::int32_t count, const std::vector<float>& points) {
    bytes.append(reinterpret_cast<const char*>(&count), sizeof(count));
    bytes.append(reinterpret_cast<const char*>(points.data()), points.size() * sizeof(float));
  };
  add(3, {0, 0, 0, 1, 0.5f, 0.1f, 2, 0, 0});
  add(-3, {0, 1, 0, 1, 1, 0, 1, 2, 0.2f});
  return bytes;
}

// Binary glTF: a triangle with texture coordinates.
std::string small_glb() {
  std::string json =
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,)"
      R"("scale":[1,-2,1]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},)"
      R"("indices":2}]}],"buffers":[{"byteLength":66}],"bufferViews":[{"buffer":0,"byteLength":36},)"
      R"({"buffer":0,"byteOffset":36,"byteLength":24},{"buffer":0,"byteOffset":60,"byteLength":6}],)"
      R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},)"
      R"({"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"},)"
      R"({"bufferView":2,"componentType":5123,"count":3,"type":"SCALAR"}]})";
  json.resize((json.size() + 3) / 4 * 4, ' ');
  std::string data;
  for (const float number :
       {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 1.f, 1.f, 1.f, 0.f, 0.f}) {
    data.append(reinterpret_cast<const char*>(&number), sizeof(number));
  }
  data += {0, 0, 1, 0, 2, 0, 0, 0};
  const auto word = [](std::size_t value) {
    const auto number = static_cast<std::uint32_t>(value);
    return std::string(reinterpret_cast<const char*>(&number), sizeof(number));
  };
  return "glTF" + word(2) + word(28 + json.size() + data.size()) + word(json.size()) + "JSON" +
         json + word(data.size()) + std::string("BIN\0", 4) + data;
}

void put_texts() {
  for (const char* name : {"tiny.textproto", "knit_jersey.textproto"}) {
    const std::filesystem::path path = source / "examples" / name;
    if (std::filesystem::exists(path)) {
      put("description", name, std::string(1, '\0') + core::read_file(path));
    }
  }
  put("description", "small.json",
      std::string(1, '\1') +
          R"({"name": "a", "weave": {"matrix": {"rows": ["10", "01"]}}, "yarns": [{"name": "y"}]})");
  put("wif", "twill.wif", small_wif());
  put("wif", "twill.dtx", small_dtx());
  put("wif", "twill.wpo", small_wpo());
  put("bcc", "yarns.bcc", small_bcc());
  put("gltf", "triangle.glb", small_glb());
  put("obj", "square.obj",
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n"
      "f 1/1/1 2/2/1 3/3/1 4/4/1\ng other\nf -4/-4 -3/-3 -2/-2\n");
}

std::string answer_of(std::uint8_t kind, const std::function<void(core::FlatWriter&)>& write) {
  const std::filesystem::path path = corpus / "answer.tmp";
  FILE* file = std::fopen(path.c_str(), "wb");
  core::FlatWriter writer(fileno(file));
  write(writer);
  writer.flush();
  std::fclose(file);
  const std::string bytes = core::read_file(path);
  std::filesystem::remove(path);
  return static_cast<char>(kind) + bytes;
}

void put_pictures() {
  weft::render::Image image(5, 4);
  image.at(2, 2) = {1, 2, 3};
  image.attributes["weft.scene"] = "{}";
  image.channels.push_back({"single.R", std::vector<float>(20, 0.5F)});
  const std::filesystem::path path = corpus / "picture.tmp";
  for (const auto pixels : {weft::render::ExrPixels::kHalf, weft::render::ExrPixels::kFloat}) {
    weft::render::write_exr(path, image, pixels);
    const bool is_half = pixels == weft::render::ExrPixels::kHalf;
    put("exr", is_half ? "half.exr" : "float.exr", core::read_file(path));
  }
  weft::render::write_png(path, 5, 4, weft::render::tone_mapped(image));
  put("png", "colours.png", core::read_file(path));
  std::filesystem::remove(path);
  const auto handed = [&](const weft::core::SandboxHandler& handler, std::uint8_t kind,
                          const std::string& bytes, std::vector<std::string> arguments) {
    return answer_of(kind, [&](core::FlatWriter& writer) {
      handler.parse(std::as_bytes(std::span(bytes)), arguments, writer);
    });
  };
  put("answer", "exr",
      handed(weft::render::exr_handler(), 2, core::read_file(corpus / "exr" / "half.exr"),
             {"a.exr", ""}));
  put("answer", "obj",
      handed(weft::render::obj_handler(), 3, core::read_file(corpus / "obj" / "square.obj"),
             {"a.obj"}));
}

// The smallest database that has everything: order 0, few angles.
void put_database() {
  weft::storage::FabricDatabase db = weft::storage::small_database();
  db.sh_order = 0;
  db.c_s.assign(std::size_t{2} * 3 * 512, 0.25F);
  db.transfer.resize(std::size_t{3} * 3);
  db.transfer_se.resize(std::size_t{3} * 3);
  const std::filesystem::path path = corpus / "database.tmp";
  weft::storage::write_database(db, path);
  const std::string bytes = core::read_file(path);
  std::filesystem::remove(path);
  put("database", "small.h5", bytes);
  const weft::core::SandboxHandler handler = weft::storage::database_handler();
  for (const char* what : {weft::storage::kArraysRequest, weft::storage::kShapesRequest}) {
    const bool is_shapes = what == weft::storage::kShapesRequest;
    put("answer", what, answer_of(is_shapes ? 1 : 0, [&](core::FlatWriter& writer) {
          handler.parse(std::as_bytes(std::span(bytes)), {what}, writer);
        }));
  }
}

v1::FabricDescription tiny() {
  return weft::fabric::load_description(source / "examples" / "tiny.textproto");
}

void put_journal() {
  const std::filesystem::path folder = corpus / "journal.tmp";
  std::filesystem::remove_all(folder);
  {
    weft::coordinator::SchedulerOptions options;
    options.state_folder = folder;
    options.commit = [](auto&&...) { return core::Digest(); };
    weft::coordinator::Scheduler scheduler(std::move(options), core::system_clock());
    put("journal", "fresh.db", "");
    for (const char* id : {"one", "two"}) {
      v1::SubmitRequest request;
      request.set_request_id(id);
      *request.mutable_description() = tiny();
      static_cast<void>(scheduler.submit(request, {}));
    }
  }
  put("journal", "two_jobs.db", core::read_file(folder / "journal.db"));
  std::filesystem::remove_all(folder);
}

// Something in every field that a message has, once.
void fill(google::protobuf::Message& message, int depth) {
  const auto& fields = *message.GetReflection();
  for (int f = 0; f < message.GetDescriptor()->field_count(); ++f) {
    const FieldDescriptor* field = message.GetDescriptor()->field(f);
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      if (depth > 0 && !field->is_repeated()) {
        fill(*fields.MutableMessage(&message, field), depth - 1);
      } else if (depth > 0) {
        fill(*fields.AddMessage(&message, field), depth - 1);
      }
    } else if (!field->is_repeated() && field->cpp_type() == FieldDescriptor::CPPTYPE_STRING) {
      const bool is_bytes = field->type() == FieldDescriptor::TYPE_BYTES;
      // Jobs are found by the beginning of their ids.
      const char* const text = field->name() == "job_id" ? "j" : "one";
      fields.SetString(&message, field, is_bytes ? std::string(32, 'd') : text);
    } else if (!field->is_repeated() && field->cpp_type() == FieldDescriptor::CPPTYPE_UINT64) {
      fields.SetUInt64(&message, field, 1);
    } else if (!field->is_repeated() && field->cpp_type() == FieldDescriptor::CPPTYPE_UINT32) {
      fields.SetUInt32(&message, field, 1);
    }
  }
}

// For each method an empty request and a full one, and a submission that is right.
void put_requests() {
  const auto* file = v1::SubmitRequest::descriptor()->file();
  int number = 0;
  for (int s = 0; s < file->service_count(); ++s) {
    for (int m = 0; m < file->service(s)->method_count(); ++m, ++number) {
      const auto* method = file->service(s)->method(m);
      const std::unique_ptr<google::protobuf::Message> message(
          google::protobuf::MessageFactory::generated_factory()
              ->GetPrototype(method->input_type())
              ->New());
      const std::string first(1, static_cast<char>(number));
      put("rpc", method->name() + "_empty", first);
      fill(*message, 2);
      put("rpc", method->name() + "_full", first + message->SerializeAsString());
      if (method->name() == "Submit") {
        v1::SubmitRequest request;
        request.set_request_id("one");
        *request.mutable_description() = tiny();
        put("rpc", "Submit_right", first + request.SerializeAsString());
      }
    }
  }
}

void put_spool() {
  v1::Completion fragment;
  fragment.set_job_id("job");
  fragment.set_attempt(1);
  fragment.set_lease_token("token");
  v1::ShardResult& result = *fragment.add_results();
  result.set_shard(3);
  result.set_digest(std::string(32, 'd'));
  result.set_size_bytes(4);
  put("spool", "fragment", "\1" + fragment.SerializeAsString());
}

// An order of a picture with one attached file.
void put_orders() {
  v1::RenderOrder order;
  order.set_request_id("one");
  *order.mutable_scene() = weft::render::parse_scene(
      core::read_file(source / "examples" / "scenes" / "handkerchief.textproto"), "s.textproto",
      "");
  weft::render::expand_picture_defaults(*order.mutable_scene());
  const std::string mesh = core::read_file(corpus / "obj" / "square.obj");
  for (const std::string& file : weft::render::files_of(order.scene())) {
    v1::Attachment& attachment = *order.add_attachments();
    attachment.set_name(file);
    attachment.set_digest(core::digest_of(mesh).binary());
    attachment.set_size_bytes(mesh.size());
  }
  const std::string message = order.SerializeAsString();
  put("order", "handkerchief",
      std::string(1, '\0') + static_cast<char>(message.size() % 256) +
          static_cast<char>(message.size() / 256) + message + mesh);
  for (const char* name : {"swatch", "damask"}) {
    const std::string text =
        core::read_file(source / "examples" / "scenes" / (std::string(name) + ".textproto"));
    put("order", name, "\1" + text);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: fuzz_make_seeds SOURCE_DIR FOLDER\n", stderr);
    return 2;
  }
  source = argv[1];
  corpus = argv[2];
  std::filesystem::create_directories(corpus);
  put_texts();
  put_pictures();
  put_database();
  put_journal();
  put_requests();
  put_orders();
  put_spool();
  return 0;
}
