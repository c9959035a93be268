// SPDX-License-Identifier: Apache-2.0
#include "store/jpeg/libjpeg.h"

#include <jerror.h>

#include <algorithm>
#include <cstdint>
#include <new>
#include <string>

#include "base/error.h"

namespace raystage::store::libjpeg {
namespace {

ErrorManager& manager_of(j_common_ptr info) {
  return *reinterpret_cast<ErrorManager*>(info->err);  // its first member
}

[[noreturn]] void leave(j_common_ptr info) {
  ErrorManager& errors = manager_of(info);
  errors.out_of_memory = info->err->msg_code == JERR_OUT_OF_MEMORY;
  info->err->format_message(info, errors.text);
  std::longjmp(errors.return_point, 1);
}

// Returns whether the warning "%u extraneous bytes before marker" is about filler, which is
// harmless.
bool is_camera_padding(j_common_ptr info) {
  if (info->err->msg_code != JWRN_EXTRANEOUS_DATA || !info->is_decompressor) return false;
  const auto* decompress = reinterpret_cast<j_decompress_ptr>(info);
  const jpeg_source_mgr* source = decompress->src;
  const auto& errors = *reinterpret_cast<const ErrorManager*>(info->err);
  const auto discarded = static_cast<std::size_t>(info->err->msg_parm.i[0]);
  // libjpeg has read both bytes of the marker when it reports this, one of them after the count.
  const JOCTET* after_marker = source->next_input_byte;
  if (errors.input == nullptr || after_marker - errors.input < 2) return false;
  return is_filler(errors.input, after_marker - 2, discarded);
}

void on_message(j_common_ptr info, int level) {
  if (level >= 0) return;  // a trace
  const int code = info->err->msg_code;
  if (code == JWRN_ADOBE_XFORM || code == JWRN_JFIF_MAJOR || is_camera_padding(info)) return;
  ErrorManager& errors = manager_of(info);
  errors.damaged = true;
  leave(info);
}

}  // namespace

bool is_filler(const std::uint8_t* begin, const std::uint8_t* end, std::size_t count) {
  if (static_cast<std::size_t>(end - begin) < count) return false;
  return std::all_of(end - count, end, [](std::uint8_t b) { return b == 0x00 || b == 0xFF; });
}

ErrorManager::ErrorManager() {
  jpeg_std_error(&base);
  base.error_exit = leave;
  base.emit_message = on_message;
  base.output_message = [](j_common_ptr) {};
}

void throw_error(const ErrorManager& errors, std::string_view name) {
  if (errors.out_of_memory) throw std::bad_alloc();
  throw Error::bad_input(
      std::string(errors.damaged ? "damaged JPEG: " : "unusable JPEG: ") + errors.text,
      std::string(name), "Replace the file or remove the frame");
}

Decompressor::Decompressor() {
  info.err = &errors.base;
  if (!guarded(errors, [this] { jpeg_create_decompress(&info); })) throw std::bad_alloc();
}

Decompressor::~Decompressor() { jpeg_destroy_decompress(&info); }

void Decompressor::set_input(std::span<const std::byte> jpeg) {
  errors.input = reinterpret_cast<const JOCTET*>(jpeg.data());
  jpeg_mem_src(&info, errors.input, static_cast<unsigned long>(jpeg.size()));
}

Compressor::Compressor() {
  info.err = &errors.base;
  if (!guarded(errors, [this] { jpeg_create_compress(&info); })) throw std::bad_alloc();
}

Compressor::~Compressor() { jpeg_destroy_compress(&info); }

VectorDestination::VectorDestination(jpeg_compress_struct& info, std::vector<std::byte>& room)
    : room_(room) {
  base_.init_destination = init;
  base_.empty_output_buffer = grow;
  base_.term_destination = finish;
  base_.next_output_byte = nullptr;
  base_.free_in_buffer = 0;
  info.dest = &base_;
}

void VectorDestination::init(j_compress_ptr info) {
  auto& self = *reinterpret_cast<VectorDestination*>(info->dest);
  if (self.room_.empty()) {
    grow(info);
    return;
  }
  self.base_.next_output_byte = reinterpret_cast<JOCTET*>(self.room_.data());
  self.base_.free_in_buffer = self.room_.size();
}

boolean VectorDestination::grow(j_compress_ptr info) {
  auto& self = *reinterpret_cast<VectorDestination*>(info->dest);
  const std::size_t used = self.room_.size();  // libjpeg calls when the buffer is full
  bool grown = false;
  try {
    self.room_.resize(std::max<std::size_t>(used * 2, 65536));
    grown = true;
  } catch (const std::bad_alloc&) {
  }
  if (!grown) ERREXIT1(info, JERR_OUT_OF_MEMORY, 0);
  self.base_.next_output_byte = reinterpret_cast<JOCTET*>(self.room_.data() + used);
  self.base_.free_in_buffer = self.room_.size() - used;
  return TRUE;
}

void VectorDestination::finish(j_compress_ptr info) {
  auto& self = *reinterpret_cast<VectorDestination*>(info->dest);
  self.size_ = self.room_.size() - self.base_.free_in_buffer;
}

}  // namespace raystage::store::libjpeg
