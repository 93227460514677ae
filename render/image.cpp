#include "render/image.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <limits>
#include <string_view>

#include <ImathBox.h>
#include <OpenEXR/ImfArray.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfThreading.h>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"

namespace weft::render {
namespace {

constexpr std::uint64_t kFileLimitBytes = std::uint64_t{4} << 30;
constexpr const char* kColourChannels[] = {"R", "G", "B"};

// OpenEXR writes into memory, so that the file appears on disk whole or not at all.
class MemoryOutput : public Imf::OStream {
 public:
  MemoryOutput() : Imf::OStream("memory") {}
  void write(const char data[], int size) override {
    const auto count = static_cast<std::size_t>(size);
    bytes_.resize(std::max(bytes_.size(), position_ + count));
    std::memcpy(bytes_.data() + position_, data, count);
    position_ += count;
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override { position_ = position; }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  std::size_t position_ = 0;
};

class MemoryInput : public Imf::IStream {
 public:
  explicit MemoryInput(std::string_view bytes) : Imf::IStream("memory"), bytes_(bytes) {}
  bool read(char data[], int size) override {
    const auto count = static_cast<std::size_t>(size);
    if (position_ > bytes_.size() || count > bytes_.size() - position_) {
      throw core::Error(core::Code::kDataLoss, "the file ends too early");
    }
    std::memcpy(data, bytes_.data() + position_, count);
    position_ += count;
    return position_ < bytes_.size();
  }
  std::uint64_t tellg() override { return position_; }
  void seekg(std::uint64_t position) override { position_ = position; }

 private:
  std::string_view bytes_;
  std::size_t position_ = 0;
};

std::vector<half> to_half(const std::vector<glm::vec3>& pixels) {
  std::vector<half> values;
  values.reserve(pixels.size() * 3);
  constexpr float kLargest = 65504.0f;
  for (const glm::vec3& pixel : pixels) {
    for (int c = 0; c < 3; ++c) {
      values.emplace_back(std::clamp(pixel[c], -kLargest, kLargest));
    }
  }
  return values;
}

Imf::FrameBuffer interleaved(Imf::PixelType type, char* base, std::size_t element_bytes,
                             std::uint32_t width) {
  Imf::FrameBuffer buffer;
  for (std::size_t c = 0; c < 3; ++c) {
    buffer.insert(kColourChannels[c], Imf::Slice(type, base + c * element_bytes, 3 * element_bytes,
                                                 3 * element_bytes * width));
  }
  return buffer;
}

// The channel that colour c is read from.
const char* channel_for(const Imf::ChannelList& channels, std::size_t c,
                        const std::filesystem::path& path) {
  if (channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B")) {
    return kColourChannels[c];
  }
  if (channels.findChannel("Y") && !channels.findChannel("RY")) {
    return "Y";
  }
  std::string names;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel) {
    names += names.empty() ? channel.name() : std::string(", ") + channel.name();
  }
  throw core::Error(core::Code::kInvalidArgument,
                    path.string() + ": the picture has the channels " + names +
                        "; give one with the channels R, G, B or with Y alone");
}

Image read_from(MemoryInput& input, const std::filesystem::path& path) {
  Imf::InputFile file(input, 0);
  const Imath::Box2i window = file.header().dataWindow();
  const std::int64_t width = std::int64_t{window.max.x} - window.min.x + 1;
  const std::int64_t height = std::int64_t{window.max.y} - window.min.y + 1;
  if (width < 1 || height < 1 || width > kImageSideLimit || height > kImageSideLimit) {
    throw core::Error(core::Code::kInvalidArgument,
                      path.string() + ": the picture is " + std::to_string(width) + " x " +
                          std::to_string(height) + " pixels; at most " +
                          std::to_string(kImageSideLimit) + " a side can be read");
  }
  Image image(static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height));
  // One plane at a time: a frame buffer cannot name a channel twice, and grey fills all three.
  std::vector<float> plane(image.pixels.size());
  for (std::size_t c = 0; c < 3; ++c) {
    Imf::FrameBuffer buffer;
    buffer.insert(channel_for(file.header().channels(), c, path),
                  Imf::Slice::Make(Imf::FLOAT, plane.data(), window));
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y, window.max.y);
    for (std::size_t i = 0; i < plane.size(); ++i) {
      image.pixels[i][static_cast<int>(c)] = plane[i];
    }
  }
  for (auto attribute = file.header().begin(); attribute != file.header().end(); ++attribute) {
    const auto* text = dynamic_cast<const Imf::StringAttribute*>(&attribute.attribute());
    if (text != nullptr) {
      image.attributes[attribute.name()] = text->value();
    }
  }
  return image;
}

}  // namespace

void write_exr(const std::filesystem::path& path, const Image& image, ExrPixels pixels) {
  CHECK_EQ(image.pixels.size(), static_cast<std::size_t>(image.width) * image.height);
  CHECK(!image.pixels.empty());
  const bool halves = pixels == ExrPixels::kHalf;
  const Imf::PixelType type = halves ? Imf::HALF : Imf::FLOAT;
  Imf::Header header(static_cast<int>(image.width), static_cast<int>(image.height));
  header.compression() = Imf::ZIP_COMPRESSION;
  for (const char* name : kColourChannels) {
    header.channels().insert(name, Imf::Channel(type));
  }
  for (const auto& [name, value] : image.attributes) {
    header.insert(name, Imf::StringAttribute(value));
  }
  std::vector<half> half_values;
  std::vector<glm::vec3> float_values;
  char* base = nullptr;
  if (halves) {
    half_values = to_half(image.pixels);
    base = reinterpret_cast<char*>(half_values.data());
  } else {
    float_values = image.pixels;
    base = reinterpret_cast<char*>(float_values.data());
  }
  MemoryOutput output;
  try {
    Imf::OutputFile file(output, header, 0);
    file.setFrameBuffer(
        interleaved(type, base, halves ? sizeof(half) : sizeof(float), image.width));
    file.writePixels(static_cast<int>(image.height));
  } catch (const std::exception& error) {
    throw core::Error(core::Code::kInternal,
                      path.string() + ": OpenEXR refused the picture: " + error.what());
  }
  core::write_file_atomically(path, output.bytes());
}

Image read_exr(const std::filesystem::path& path) {
  const std::string bytes = core::read_file(path, kFileLimitBytes);
  MemoryInput input(bytes);
  try {
    return read_from(input, path);
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kDataLoss) {
      throw;
    }
    throw core::Error(core::Code::kDataLoss, path.string() + ": not a whole OpenEXR picture: " +
                                                 error.what() + "; make or fetch it again");
  } catch (const std::exception& error) {
    throw core::Error(core::Code::kDataLoss,
                      path.string() + ": not an OpenEXR picture that can be read: " + error.what());
  }
}

}  // namespace weft::render
