// SPDX-License-Identifier: Apache-2.0
// Writes a take in a temporary folder next to its final one and renames it on commit(), after all
// files are on disk.
#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <optional>
#include <system_error>
#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/temporary_folder.h"
#include "store/take.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

void check_ids(const schemas::TakeDocument& take, const schemas::RigDocument& rig) {
  const std::string where = "take \"" + take.name + "\"";
  if (take.cameras.empty() || take.cameras.size() != rig.cameras.size()) {
    throw Error::bad_input("the take has " + std::to_string(take.cameras.size()) +
                               " cameras, but its rig has " + std::to_string(rig.cameras.size()),
                           where, "Give both the same cameras, at least one");
  }
  for (std::size_t i = 0; i < take.cameras.size(); ++i) {
    const std::string& id = take.cameras[i].id;
    if (id != rig.cameras[i].geometry.id) {
      throw Error::bad_input("camera " + std::to_string(i) + " is \"" + id +
                                 "\" in the take and \"" + rig.cameras[i].geometry.id +
                                 "\" in its rig",
                             where, "Give both the same cameras in the same order");
    }
    const bool safe = !id.empty() && id.size() <= 100 && id[0] != '.' &&
                      id.find_first_not_of(
                          "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
                          "0123456789._-") == std::string::npos;
    if (!safe) {
      throw Error::bad_input("the camera id \"" + id + "\" is not a safe file name", where,
                             "Use up to 100 letters, digits, '.', '_' and '-', no leading '.'");
    }
  }
}

}  // namespace

struct TakeWriter::State {
  std::optional<TemporaryFolder> folder;
  schemas::TakeDocument take;
  schemas::RigDocument rig;
  FrameCodec codec = FrameCodec::kJpeg;
  std::vector<std::optional<ArchiveWriter>> archives;
  bool finished = false, committed = false;
};

void TakeWriter::require_absent(const fs::path& folder) {
  const fs::path target = path_with_name(folder);
  if (!is_name_taken(target)) return;
  throw Error::bad_input("a file or folder of this name exists", target.string(),
                         "Choose another name for the take, or remove it");
}

TakeWriter::TakeWriter(const fs::path& folder, schemas::TakeDocument take, schemas::RigDocument rig,
                       FrameCodec codec)
    : state_(std::make_unique<State>()) {
  check_ids(take, rig);
  for (schemas::TakeDocument::Camera& camera : take.cameras) {
    camera.archive = "archive/" + camera.id + ".mkv";
    camera.journal = "archive/" + camera.id + ".journal";
  }
  // Reject documents that could not be read back now, not after the last frame.
  schemas::parse_take(schemas::format_take(take), "take.json");
  schemas::parse_rig(schemas::format_rig(rig), "rig.json");

  state_->archives.resize(take.cameras.size());
  state_->take = std::move(take);
  state_->codec = codec;
  state_->rig = std::move(rig);
  require_absent(folder);
  state_->folder.emplace(folder);
  try {
    create_folder(state_->folder->path() / "archive");
  } catch (const Error& error) {
    throw Error::failed(error.what_happened(), state_->folder->target().string(),
                        error.what_to_do());
  }
}

TakeWriter::~TakeWriter() = default;

ArchiveWriter& TakeWriter::archive(int camera) {
  const auto index = static_cast<std::size_t>(camera);
  assert(camera >= 0 && index < state_->archives.size());
  auto& slot = state_->archives[index];
  if (!slot) {
    const schemas::TakeDocument::Camera& entry = state_->take.cameras[index];
    const schemas::CameraGeometry& geometry = state_->rig.cameras[index].geometry;
    slot.emplace(working_folder() / entry.archive, working_folder() / entry.journal,
                 ArchiveWriter::Description{entry.id, geometry.width, geometry.height,
                                            state_->take.epoch_utc,
                                            entry.pixels ? FrameCodec::kPicture : state_->codec});
  }
  return *slot;
}

void TakeWriter::set_peak(int camera, double peak) {
  auto& pixels = state_->take.cameras[static_cast<std::size_t>(camera)].pixels;
  assert(pixels && !state_->finished);
  pixels->peak = peak;
}

const fs::path& TakeWriter::working_folder() const { return state_->folder->path(); }

void TakeWriter::finish() {
  assert(!state_->finished);
  for (int i = 0; i < static_cast<int>(state_->archives.size()); ++i) archive(i).close();
  finish_documents();
}

void TakeWriter::finish_documents() {
  assert(!state_->finished);
  schemas::write_rig(state_->rig, working_folder() / "rig.json");
  schemas::write_take(state_->take, working_folder() / "take.json");
  state_->finished = true;
}

void TakeWriter::commit() {
  assert(!state_->committed);
  if (!state_->finished) finish();
  if (!state_->folder->commit()) {
    throw Error::from_errno("the finished take cannot be renamed to its final name",
                            state_->folder->target().string(),
                            "Check that no file of this name was created meanwhile");
  }
  state_->committed = true;
}

}  // namespace raystage::store
