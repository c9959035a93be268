// SPDX-License-Identifier: Apache-2.0
#include <OpenEXR/ImfDeepScanLineInputPart.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfStringVectorAttribute.h>

#include <cstdint>

#include "base/error.h"
#include "images/exr_decoding.h"
#include "images/exr_header_check.h"

namespace raystage::images {
namespace {

/// Returns the scan lines per chunk (OpenEXR file layout); 1 is correct for all, only slower.
int lines_per_chunk(Imf::Compression compression) {
  switch (compression) {
    case Imf::ZIP_COMPRESSION:
      return 16;
    case Imf::PIZ_COMPRESSION:
      return 32;
    default:
      return 1;
  }
}

/// Reads all chunks. Throws if one is missing.
void read_deep_chunks(Imf::MultiPartInputFile& input, int index) {
  Imf::DeepScanLineInputPart part(input, index);
  const Imath::Box2i window = part.header().dataWindow();
  std::vector<char> chunk;
  for (std::int64_t y = window.min.y; y <= window.max.y; ++y) {  // one line per chunk
    std::uint64_t size = 0;
    part.rawPixelData(static_cast<int>(y), nullptr, size);
    chunk.resize(size);
    part.rawPixelData(static_cast<int>(y), chunk.data(), size);
  }
}

void read_chunks(Imf::MultiPartInputFile& input, int index) {
  Imf::InputPart part(input, index);
  const Imath::Box2i window = part.header().dataWindow();
  const int step = lines_per_chunk(part.header().compression());
  for (std::int64_t y = window.min.y; y <= window.max.y; y += step) {
    const char* data = nullptr;
    int size = 0;
    part.rawPixelData(static_cast<int>(y), data, size);
  }
}

/// Returns whether all parts have all chunks. A truncated file may have all offsets.
bool has_all_chunks(Imf::MultiPartInputFile& input) {
  try {
    for (int i = 0; i < input.parts(); ++i) {
      if (!input.partComplete(i)) return false;
      const Imf::Header& header = input.header(i);
      const bool is_deep = header.hasType() && header.type() == Imf::DEEPSCANLINE;
      is_deep ? read_deep_chunks(input, i) : read_chunks(input, i);
    }
    return true;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception&) {
    return false;
  }
}

std::string fingerprint_of(const Imf::Header& header) {
  const auto* stated = header.findTypedAttribute<Imf::StringAttribute>("lf:fingerprint");
  return stated == nullptr ? std::string() : stated->value();
}

}  // namespace

ExrInspection decode_exr_inspection(const std::filesystem::path& file) {
  constexpr int kNoThreads = 0;
  try {
    require_plausible_exr_header(file);
    Imf::MultiPartInputFile input(file.c_str(), kNoThreads);
    const Imf::Header& header = input.header(0);
    ExrInspection result;
    result.fingerprint = fingerprint_of(header);
    bool is_same = true;
    for (int i = 1; i < input.parts(); ++i) {
      is_same = is_same && fingerprint_of(input.header(i)) == result.fingerprint;
    }
    result.is_complete = is_same && has_all_chunks(input);
    if (const auto* share = header.findTypedAttribute<Imf::DoubleAttribute>("lf:coveredShare")) {
      result.covered_share = share->value();
    }
    if (const auto* rotten =
            header.findTypedAttribute<Imf::StringVectorAttribute>("lf:rottenCameras")) {
      result.rotten_cameras = rotten->value();
    }
    return result;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    throw Error::bad_input(error.what(), file.string(), "Render the frame again");
  }
}

}  // namespace raystage::images
