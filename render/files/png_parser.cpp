#include "render/files/png_parser.h"

#include <algorithm>

#include <png.h>

#include "core/check.h"
#include "core/error.h"

namespace weft::render {
namespace {

// What libpng reads from; its error callback finds the name here.
struct PngSource {
  std::string_view left;
  const std::string& name;
};

[[noreturn]] void fail_reading(png_structp png, png_const_charp message) {
  const auto* source = static_cast<const PngSource*>(png_get_error_ptr(png));
  throw core::Error(core::Code::kDataLoss,
                    source->name + " cannot be read as PNG: " + message + "; save it again");
}

void ignore_warning(png_structp, png_const_charp) {}

void take(png_structp png, png_bytep data, png_size_t size) {
  auto* source = static_cast<PngSource*>(png_get_io_ptr(png));
  if (size > source->left.size()) {
    png_error(png, "it ends early");
  }
  std::copy_n(source->left.begin(), size, data);
  source->left.remove_prefix(size);
}

class PngReader {
 public:
  PngReader(std::string_view bytes, const std::string& name)
      : source_{bytes, name},
        png_(
            png_create_read_struct(PNG_LIBPNG_VER_STRING, &source_, fail_reading, ignore_warning)) {
    CHECK(png_ != nullptr);
    info_ = png_create_info_struct(png_);
    CHECK(info_ != nullptr);
    png_set_read_fn(png_, &source_, take);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;
  PngReader(PngReader&&) = delete;
  PngReader& operator=(PngReader&&) = delete;
  [[nodiscard]] png_structp png() const { return png_; }
  [[nodiscard]] png_infop info() const { return info_; }

 private:
  PngSource source_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

}  // namespace

PlainPicture parse_plain_png(std::string_view bytes, const std::string& name,
                             std::uint32_t side_limit) {
  PngReader reader(bytes, name);
  const png_structp png = reader.png();
  png_read_info(png, reader.info());
  PlainPicture picture;
  picture.width = png_get_image_width(png, reader.info());
  picture.height = png_get_image_height(png, reader.info());
  const png_byte type = png_get_color_type(png, reader.info());
  picture.has_palette = type == PNG_COLOR_TYPE_PALETTE;
  if ((type != PNG_COLOR_TYPE_PALETTE && type != PNG_COLOR_TYPE_GRAY &&
       type != PNG_COLOR_TYPE_GRAY_ALPHA) ||
      png_get_bit_depth(png, reader.info()) > 8) {
    throw core::Error(core::Code::kInvalidArgument,
                      name +
                          " has colours of its own or more than 8 bits; save it as a PNG with a "
                          "palette, or with 8-bit grey levels");
  }
  if (picture.width > side_limit || picture.height > side_limit) {
    throw core::Error(
        core::Code::kInvalidArgument,
        name + " is too large; give at most " + std::to_string(side_limit) + " pixels a side");
  }
  png_set_packing(png);
  png_set_strip_alpha(png);
  const int passes = png_set_interlace_handling(png);
  png_read_update_info(png, reader.info());
  CHECK_EQ(png_get_rowbytes(png, reader.info()), std::size_t{picture.width});
  picture.values.resize(std::size_t{picture.width} * picture.height);
  for (int pass = 0; pass < passes; ++pass) {
    for (std::uint32_t y = 0; y < picture.height; ++y) {
      png_read_row(png, picture.values.data() + std::size_t{picture.width} * y, nullptr);
    }
  }
  return picture;
}

core::SandboxHandler png_handler() {
  return {[] {},
          [](std::span<const std::byte> file, const std::vector<std::string>& arguments,
             core::FlatWriter& answer) {
            const std::string_view bytes(reinterpret_cast<const char*>(file.data()), file.size());
            const auto side_limit = static_cast<std::uint32_t>(std::stoul(arguments.at(1)));
            const PlainPicture picture = parse_plain_png(bytes, arguments.at(0), side_limit);
            answer.number(picture.width);
            answer.number(picture.height);
            answer.number(picture.has_palette ? 1 : 0);
            answer.bytes(std::as_bytes(std::span(picture.values)));
          }};
}

PlainPicture plain_picture_from(core::FlatReader answer, std::uint32_t side_limit) {
  const std::uint64_t width = answer.number();
  const std::uint64_t height = answer.number();
  PlainPicture picture;
  picture.has_palette = answer.number() != 0;
  const std::span<const std::byte> values = answer.bytes();
  answer.end();
  if (width == 0 || height == 0 || width > side_limit || height > side_limit ||
      values.size() != width * height) {
    throw core::Error(core::Code::kDataLoss, "the picture did not come back whole");
  }
  picture.width = static_cast<std::uint32_t>(width);
  picture.height = static_cast<std::uint32_t>(height);
  const auto* first = reinterpret_cast<const std::uint8_t*>(values.data());
  picture.values.assign(first, first + values.size());
  return picture;
}

}  // namespace weft::render
