// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/error.h"
#include "sandbox/byte_encoding.h"

namespace raystage::sandbox {

/// For decoders whose reasons to refuse a file come with an advice: the first byte of an answer.
enum class AnswerKind : std::uint8_t {
  kResult,
  kError  ///< what happened and what to do follow, as texts
};

/// Returns what write(ByteWriter) writes, or the Error that it throws. For the decoder.
template <class Write>
std::vector<std::byte> answer_or_error(const Write& write) {
  ByteWriter answer;
  try {
    answer.write(static_cast<std::uint8_t>(AnswerKind::kResult));
    write(answer);
  } catch (const Error& error) {
    answer = {};
    answer.write(static_cast<std::uint8_t>(AnswerKind::kError));
    answer.write_plain(error.what_happened());
    answer.write_plain(error.what_to_do());
  }
  return answer.take();
}

/// Returns read(ByteReader) of an answer, for the parent. Throws the Error that it holds instead,
/// or Error (bad input) if it is damaged; both name the file. `kind`: of the file, such as "movie".
template <class Read>
auto read_answer(std::span<const std::byte> answer, const std::string& kind,
                 const std::filesystem::path& file, const Read& read) {
  constexpr std::size_t kMaxText = 16'000;  // text of a stranger; lists of names are long
  try {
    ByteReader reader(answer);
    if (reader.read<std::uint8_t>() == static_cast<std::uint8_t>(AnswerKind::kResult)) {
      return read(reader);
    }
    std::string what, what_to_do;
    reader.read_plain(what);
    reader.read_plain(what_to_do);
    throw Error::bad_input(what.substr(0, kMaxText), file.string(), what_to_do.substr(0, kMaxText));
  } catch (const std::runtime_error& error) {
    throw Error::bad_input("the " + kind + " cannot be read: " + error.what(), file.string(),
                           "Save it again");
  }
}

}  // namespace raystage::sandbox
