// SPDX-License-Identifier: Apache-2.0
#include "images/png_codes.h"

#include <png.h>

#include <array>
#include <bit>
#include <csetjmp>
#include <cstring>
#include <new>
#include <stdexcept>

namespace raystage::images {
namespace {

/// libpng's reader of one image. It ends functions that fail by longjmp(), which must not pass
/// objects with destructors: guarded() calls it with nothing else.
class PngReader {
 public:
  explicit PngReader(const ReadBytes& read) : read_(read) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, on_error, on_warning);
    info_ = png_ != nullptr ? png_create_info_struct(png_) : nullptr;
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, nullptr, nullptr);
      throw std::bad_alloc();
    }
    png_set_read_fn(png_, this, on_read);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  ImageProperties read_header() {
    guarded([this] {
      png_read_info(png_, info_);
      png_set_expand(png_);
      png_set_interlace_handling(png_);
      if constexpr (std::endian::native == std::endian::little) png_set_swap(png_);
      png_read_update_info(png_, info_);
    });
    ImageProperties properties;
    properties.width = properties.full_width = static_cast<int>(png_get_image_width(png_, info_));
    properties.height = properties.full_height =
        static_cast<int>(png_get_image_height(png_, info_));
    properties.x = png_get_x_offset_pixels(png_, info_);
    properties.y = png_get_y_offset_pixels(png_, info_);
    properties.channels = png_get_channels(png_, info_);
    const bool has_alpha = (png_get_color_type(png_, info_) & PNG_COLOR_MASK_ALPHA) != 0;
    properties.alpha_channel = has_alpha ? properties.channels - 1 : -1;
    constexpr int kDeep = 16;
    properties.type =
        png_get_bit_depth(png_, info_) == kDeep ? PixelType::kUint16 : PixelType::kUint8;
    return properties;
  }

  void read_rows(std::vector<png_bytep>& rows) {
    png_bytep* const first = rows.data();
    guarded([this, first] { png_read_image(png_, first); });
  }
  std::size_t row_bytes() const { return png_get_rowbytes(png_, info_); }

 private:
  template <class Call>
  void guarded(const Call& call) {
    if (setjmp(png_jmpbuf(png_)) != 0) throw std::runtime_error(error_.data());
    call();
  }
  static void on_error(png_structp png, png_const_charp text) {
    auto& error = static_cast<PngReader*>(png_get_error_ptr(png))->error_;
    std::strncpy(error.data(), text, error.size() - 1);  // nothing here may throw
    png_longjmp(png, 1);
  }
  static void on_warning(png_structp /*png*/, png_const_charp /*text*/) {}
  static void on_read(png_structp png, png_bytep to, std::size_t count) {
    const auto* const self = static_cast<const PngReader*>(png_get_io_ptr(png));
    if (!self->read_(reinterpret_cast<std::byte*>(to), count)) {
      png_error(png, "it ends before its last row");
    }
  }

  const ReadBytes& read_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::array<char, 200> error_{};
};

}  // namespace

PngCodes read_png_codes(const ReadBytes& read,
                        const std::function<bool(const ImageProperties&)>& accept) {
  PngReader reader(read);
  PngCodes image{reader.read_header(), {}};
  if (!accept(image.properties)) return image;
  const auto height = static_cast<std::size_t>(image.properties.height);
  image.codes.resize(reader.row_bytes() * height);
  std::vector<png_bytep> rows(height);
  for (std::size_t y = 0; y < height; ++y) {
    rows[y] = image.codes.data() + y * reader.row_bytes();
  }
  reader.read_rows(rows);
  return image;
}

}  // namespace raystage::images
