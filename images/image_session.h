// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "images/image_properties.h"
#include "sandbox/decoder_process.h"

namespace raystage::images {

/// Images that confined processes keep open, to read parts of them: one decodes PNG and JPEG, and
/// another one, which takes 0.4 s to start, all other formats and rare kinds of JPEG (CMYK, without
/// an end). Thread-safe. All functions throw Error (bad input) that names the image if it cannot be
/// read, is damaged, or needs more memory than was granted, and Error (failed) as
/// sandbox::DecoderProcess does.
class ImageSession {
 public:
  /// `memory_bytes`: that an image without tiles, or a tile, may need.
  explicit ImageSession(std::size_t memory_bytes);

  /// Starts the process that will open a file, or an image in memory, ahead of that.
  void start_for(const std::string& name, const sandbox::OpenFile& open_file);
  void start_for_bytes(std::string_view bytes);

  enum class Decoder { kPngAndJpeg, kAllFormats };
  /// An image that is open.
  struct Image {
    std::uint32_t number = 0;
    std::string name;  ///< for errors
    sandbox::OpenFile open_file;
    ImageProperties properties;
    Decoder decoder = Decoder::kAllFormats;
  };
  Image open(const std::filesystem::path& file);
  /// `open_file`: opens the file of this name.
  Image open(const std::string& name, const sandbox::OpenFile& open_file);
  /// `format`: its extension, such as "png".
  Image open_bytes(const std::string& name, const std::string& format, std::string_view bytes);
  void close(const Image& image);

  /// Returns the properties of a level of subimage 0; nullopt: there is none.
  std::optional<ImageProperties> level(const Image& image, int subimage, int level);
  /// Reads rows [begin, end).
  void read_rows(const Image& image, int subimage, int level, int begin, int end, PixelType type,
                 std::span<std::byte> pixels);
  /// Reads the tile at (x, y).
  void read_tile(const Image& image, int subimage, int level, int x, int y, PixelType type,
                 std::span<std::byte> pixels);

 private:
  struct Part;
  struct Source;
  Image open_source(const Source& source);
  /// Returns nullopt if the image is of a kind that only Decoder::kAllFormats reads.
  std::optional<Image> open_by(Decoder decoder, const Source& source);
  /// Throws std::runtime_error if reading a part needs more memory than is granted.
  void require_memory(const ImageProperties& properties) const;
  void read_part(const Image& image, const Part& part, std::span<std::byte> pixels);
  /// A decoder's process, which answers one request at a time.
  struct Process {
    std::mutex mutex;
    sandbox::DecoderProcess decoder;
  };
  Process& process(Decoder decoder) {
    return decoder == Decoder::kPngAndJpeg ? png_and_jpeg_ : all_formats_;
  }
  std::vector<std::byte> decode(Decoder decoder, std::span<const std::byte> request,
                                const std::string& name, const sandbox::OpenFile& open_file);

  std::size_t memory_bytes_;
  std::atomic<std::uint32_t> next_number_ = 1;
  Process png_and_jpeg_, all_formats_;
};

}  // namespace raystage::images
