// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace raystage::schemas {

/// Schema "raystage/shot_notes/1": what people wrote about frames of a shot.
struct ShotNotes {
  struct Note {
    int frame = 0;  ///< of the shot
    std::string text;
    std::string author;  ///< may be empty
  };
  std::vector<Note> notes;
};

/// Parses and formats the document in memory; errors use `name` as the file name. Throws Error (bad
/// input) if it is not valid.
ShotNotes parse_shot_notes(std::string_view text, std::string_view name);
std::string format_shot_notes(const ShotNotes& notes);

}  // namespace raystage::schemas
