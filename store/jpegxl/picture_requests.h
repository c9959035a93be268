// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "sandbox/byte_encoding.h"
#include "store/jpegxl/picture_coding.h"

namespace raystage::store {

/// Exchanged with raystage-transcode-jpeg. Readers throw std::runtime_error if the bytes are not
/// those of a picture: enumerators, bits, size, and the number of samples that follows from it.
void write_encoding(sandbox::ByteWriter& writer, const schemas::PixelEncoding& encoding);
schemas::PixelEncoding read_encoding(sandbox::ByteReader& reader);

void write_picture(sandbox::ByteWriter& writer, const DeepPicture& picture);
DeepPicture read_picture(sandbox::ByteReader& reader);

void write_coded_picture(sandbox::ByteWriter& writer, const CodedPicture& coded);
CodedPicture read_coded_picture(sandbox::ByteReader& reader);

}  // namespace raystage::store
