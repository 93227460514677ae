#include "render/files/exr_parser.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>

#include <ImathBox.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfThreading.h>

#include "core/error.h"

namespace weft::render {
namespace {

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
  [[nodiscard]] std::uint64_t size_bytes() const { return bytes_.size(); }
  std::uint64_t tellg() override { return position_; }
  void seekg(std::uint64_t position) override { position_ = position; }

 private:
  std::string_view bytes_;
  std::size_t position_ = 0;
};

// The channels that the three colours of a layer are read from.
std::array<std::string, 3> channels_for(const Imf::ChannelList& channels, std::string_view layer,
                                        const std::string& file_name) {
  const std::string prefix = layer.empty() ? "" : std::string(layer) + ".";
  const auto has = [&](const char* name) {
    return channels.findChannel((prefix + name).c_str()) != nullptr;
  };
  if (has("R") && has("G") && has("B")) {
    return {prefix + "R", prefix + "G", prefix + "B"};
  }
  if (has("X") && has("Y") && has("Z")) {
    return {prefix + "X", prefix + "Y", prefix + "Z"};
  }
  if (has("Y") && !has("RY")) {
    return {prefix + "Y", prefix + "Y", prefix + "Y"};
  }
  std::string names;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel) {
    names += names.empty() ? channel.name() : std::string(", ") + channel.name();
  }
  throw core::Error(
      core::Code::kInvalidArgument,
      file_name + ": the picture has the channels " + names +
          (layer.empty() ? "; give one with the channels R, G, B or with Y alone"
                         : "; none of them are colours of the layer '" + std::string(layer) + "'"));
}

Image read_from(MemoryInput& input, const std::string& name, std::string_view layer) {
  Imf::InputFile file(input, 0);
  const Imath::Box2i window = file.header().dataWindow();
  const std::int64_t width = std::int64_t{window.max.x} - window.min.x + 1;
  const std::int64_t height = std::int64_t{window.max.y} - window.min.y + 1;
  if (width < 1 || height < 1 || width > kImageSideLimit || height > kImageSideLimit) {
    throw core::Error(core::Code::kInvalidArgument,
                      name + ": the picture is " + std::to_string(width) + " x " +
                          std::to_string(height) + " pixels; at most " +
                          std::to_string(kImageSideLimit) + " a side can be read");
  }
  const std::uint64_t pixels =
      static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height);
  if (pixels > exr_pixel_limit(input.size_bytes())) {
    throw core::Error(core::Code::kResourceExhausted,
                      name + ": the picture claims " + std::to_string(pixels) +
                          " pixels, and a file of its size may hold " +
                          std::to_string(exr_pixel_limit(input.size_bytes())) +
                          "; make it smaller");
  }
  Image image(static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height));
  // One plane at a time: a frame buffer cannot name a channel twice, and grey fills all three.
  const std::array<std::string, 3> names = channels_for(file.header().channels(), layer, name);
  std::vector<float> plane(image.pixels.size());
  for (std::size_t c = 0; c < 3; ++c) {
    Imf::FrameBuffer buffer;
    buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, plane.data(), window));
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

std::uint64_t exr_pixel_limit(std::uint64_t file_bytes) {
  constexpr std::uint64_t kAllowance = std::uint64_t{1} << 20;
  constexpr std::uint64_t kPerByte = 256;  // of one colour alone, OpenEXR packs 170
  return std::min(kImagePixelLimit, kAllowance + kPerByte * std::min(file_bytes, kExrLimitBytes));
}

Image parse_exr(std::string_view bytes, const std::string& name, std::string_view layer) {
  MemoryInput input(bytes);
  try {
    return read_from(input, name, layer);
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kDataLoss) {
      throw;
    }
    throw core::Error(core::Code::kDataLoss, name + ": not a whole OpenEXR picture: " +
                                                 error.what() + "; make or fetch it again");
  } catch (const std::exception& error) {
    throw core::Error(core::Code::kDataLoss,
                      name + ": not an OpenEXR picture that can be read: " + error.what());
  }
}

core::SandboxHandler exr_handler() {
  return {[] { Imf::setGlobalThreadCount(0); },
          [](std::span<const std::byte> file, const std::vector<std::string>& arguments,
             core::FlatWriter& answer) {
            const std::string_view bytes(reinterpret_cast<const char*>(file.data()), file.size());
            const std::string layer = arguments.size() > 1 ? arguments[1] : "";
            const Image image = parse_exr(bytes, arguments.at(0), layer);
            answer.number(image.width);
            answer.number(image.height);
            answer.bytes(std::as_bytes(std::span(image.pixels)));
            answer.number(image.attributes.size());
            for (const auto& [name, value] : image.attributes) {
              answer.text(name);
              answer.text(value);
            }
          }};
}

Image image_from(core::FlatReader answer) {
  const std::uint64_t width = answer.number();
  const std::uint64_t height = answer.number();
  const std::span<const std::byte> pixels = answer.bytes();
  if (width == 0 || height == 0 || width > kImageSideLimit || height > kImageSideLimit ||
      pixels.size() != width * height * sizeof(glm::vec3)) {
    throw core::Error(core::Code::kDataLoss, "the picture did not come back whole");
  }
  Image image(static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height));
  std::memcpy(image.pixels.data(), pixels.data(), pixels.size());
  for (std::uint64_t left = answer.number(); left > 0; --left) {
    const std::string name = answer.text();
    image.attributes[name] = answer.text();
  }
  answer.end();
  return image;
}

}  // namespace weft::render
