// SPDX-License-Identifier: Apache-2.0
#include "schemas/shot_notes.h"

#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using Note = ShotNotes::Note;

constexpr Fields kNotes(required("notes", &ShotNotes::notes,
                                 list_of(Fields(required("frame", &Note::frame),
                                                required("text", &Note::text),
                                                optional("author", &Note::author)))));

}  // namespace

ShotNotes parse_shot_notes(std::string_view text, std::string_view name) {
  return parse_document_as<ShotNotes>("shot_notes", kNotes, text, name);
}

std::string format_shot_notes(const ShotNotes& notes) {
  return format_document("shot_notes", kNotes, notes);
}

}  // namespace raystage::schemas
