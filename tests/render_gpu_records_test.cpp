#include <cstdint>
#include <cstring>
#include <numeric>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render/gpu/device.h"
#include "render/gpu/geometry.h"
#include "tests/kernels/kernels.h"
#include "tests/kernels/record_fields.h"

// Whether both languages lay out every struct that crosses between them alike.

namespace weft::render::gpu {
namespace {

using testing::IsEmpty;

// The words of a record's fields, in the order that they are listed in.
class Words {
 public:
  template <typename T>
  void put(const T& field) {
    static_assert(sizeof(T) % 4 == 0);
    const std::size_t before = words_.size();
    words_.resize(before + sizeof(T) / 4);
    std::memcpy(words_.data() + before, &field, sizeof(T));
  }
  [[nodiscard]] const std::vector<std::uint32_t>& words() const { return words_; }

 private:
  std::vector<std::uint32_t> words_;
};

// A record whose words are all different, each a float of usual size.
template <typename Record>
Record numbered() {
  static_assert(std::is_trivially_copyable_v<Record> && sizeof(Record) % 4 == 0);
  std::vector<std::uint32_t> words(sizeof(Record) / 4);
  std::iota(words.begin(), words.end(), 0x3f800001U);
  Record record;
  std::memcpy(&record, words.data(), sizeof(Record));
  return record;
}

template <typename Record>
void expect_same_layout(std::uint32_t which, const Record& record, const Words& of_fields) {
  Words all;
  all.put(record);
  // Every field is listed, each once and in order, and nothing is between them.
  EXPECT_EQ(of_fields.words(), all.words());
  const auto device = Device::open("", {.validation = Validation::kOn});
  const Buffer in = device->upload(std::as_bytes(std::span(&record, 1)), "a record");
  const Buffer out = device->allocate(sizeof(Record), "its words");
  const std::vector<std::uint32_t> constants{which};
  const Kernel kernel = device->make_kernel(test_kernels::record_copy, 2, 0, constants);
  const Dispatch dispatch{.kernel = &kernel, .buffers = {&in, &out}};
  (void)device->run({&dispatch, 1});
  EXPECT_EQ(device->download<std::uint32_t>(out, sizeof(Record) / 4), all.words());
  EXPECT_THAT(device->complaints(), IsEmpty());
}

#define PUT(name) words.put(record.name);
#define RECORD_TEST(Name, which, Record, FIELDS)     \
  TEST(Records, Name) {                              \
    const auto record = numbered<shading::Record>(); \
    Words words;                                     \
    FIELDS(PUT)                                      \
    expect_same_layout(which, record, words);        \
  }

RECORD_TEST(HitIsLaidOutAlike, 0, DeviceHit, FIELDS_OF_HIT)
RECORD_TEST(ClothIsLaidOutAlike, 1, DeviceCloth, FIELDS_OF_CLOTH)
RECORD_TEST(TetrahedronIsLaidOutAlike, 2, DeviceTetrahedron, FIELDS_OF_TETRAHEDRON)
RECORD_TEST(ShellTriangleIsLaidOutAlike, 3, DeviceShellTriangle, FIELDS_OF_SHELL_TRIANGLE)
RECORD_TEST(NodeIsLaidOutAlike, 4, DeviceNode, FIELDS_OF_NODE)
RECORD_TEST(OuterFaceIsLaidOutAlike, 5, DeviceOuterFace, FIELDS_OF_OUTER_FACE)
RECORD_TEST(FabricSizesAreLaidOutAlike, 6, DeviceFabricSizes, FIELDS_OF_FABRIC_SIZES)
RECORD_TEST(SegmentIsLaidOutAlike, 7, DeviceSegment, FIELDS_OF_SEGMENT)
RECORD_TEST(LightIsLaidOutAlike, 8, DeviceLight, FIELDS_OF_LIGHT)
RECORD_TEST(SampleIsLaidOutAlike, 9, DeviceSample, FIELDS_OF_SAMPLE)
RECORD_TEST(PixelIsLaidOutAlike, 10, DevicePixel, FIELDS_OF_PIXEL)
RECORD_TEST(ShadingCallIsLaidOutAlike, 11, ShadingCall, FIELDS_OF_SHADING_CALL)
RECORD_TEST(FabricIsLaidOutAlike, 12, DeviceFabric, FIELDS_OF_FABRIC)
RECORD_TEST(CapsuleIsLaidOutAlike, 13, DeviceCapsule, FIELDS_OF_CAPSULE)
RECORD_TEST(EyeTaskIsLaidOutAlike, 14, EyeTask, FIELDS_OF_EYE_TASK)
RECORD_TEST(EyeSearchIsLaidOutAlike, 15, EyeSearch, FIELDS_OF_EYE_SEARCH)

}  // namespace
}  // namespace weft::render::gpu
