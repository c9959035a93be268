// SPDX-License-Identifier: Apache-2.0
#include "store/take.h"

#include <atomic>
#include <cassert>
#include <mutex>
#include <optional>
#include <utility>

#include "base/error.h"
#include "schemas/rig_document.h"
#include "store/frames_by_hash.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

/// Returns `folder` if it holds take.json; otherwise throws an error that says why it is not a
/// take.
const fs::path& checked_take(const fs::path& folder) {
  std::error_code unknown;  // reading reports it then
  if (fs::status(folder / "take.json", unknown).type() != fs::file_type::not_found) return folder;
  const auto type = fs::status(folder, unknown).type();
  throw Error::bad_input(std::string("this is not a take: ") +
                             (type == fs::file_type::not_found   ? "the folder does not exist"
                              : type == fs::file_type::directory ? "it has no take.json"
                                                                 : "it is a file"),
                         folder.string(), "Give the folder of a take, which has take.json");
}

}  // namespace

struct Take::State : TakeArchives {
  struct Slot {
    std::mutex opening;
    std::atomic<bool> ready = false;
    std::optional<ArchiveReader> reader;
  };

  State(std::filesystem::path path, std::shared_ptr<const RemoteArchives> others)
      : folder(std::move(path)),
        remote(std::move(others)),
        document(schemas::read_take(ContainedPath{checked_take(folder), "take.json"})),
        rig(rig::rig_from_document(schemas::read_rig(ContainedPath{folder, "rig.json"}))),
        slots(document.cameras.size()) {}

  void check_cameras() const;
  ArchiveReader open(std::size_t camera) const;
  int camera_count() const override { return static_cast<int>(slots.size()); }
  const ArchiveReader& archive(int camera) const override;
  const FramesByHash& frames_by_hash() const override { return by_hash; }

  FramesByHash by_hash;

  std::filesystem::path folder;
  std::shared_ptr<const RemoteArchives> remote;  // null: all are in the folder
  schemas::TakeDocument document;
  rig::Rig rig;
  mutable std::vector<Slot> slots;
  std::shared_ptr<FrameBuffers> buffers = std::make_shared<FrameBuffers>();
  std::shared_ptr<UnpackedFrames> unpacked = std::make_shared<UnpackedFrames>();
};

void Take::State::check_cameras() const {
  const std::string where = (folder / "take.json").string();
  const std::string advice = "Restore both files from the same take";
  if (document.cameras.size() != rig.cameras.size()) {
    throw Error::bad_input("it lists " + std::to_string(document.cameras.size()) +
                               " cameras, but rig.json has " + std::to_string(rig.cameras.size()),
                           where + "#/cameras", advice);
  }
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    if (document.cameras[i].id == rig.cameras[i].id) continue;
    throw Error::bad_input("the camera is \"" + document.cameras[i].id + "\", but rig.json has \"" +
                               rig.cameras[i].id + "\"",
                           where + "#/cameras/" + std::to_string(i) + "/id", advice);
  }
}

ArchiveReader Take::State::open(std::size_t camera) const {
  const auto& entry = document.cameras[camera];
  if (remote) {
    if (auto elsewhere = remote->open(static_cast<int>(camera))) {
      if (entry.pixels) elsewhere->set_pixel_encoding(*entry.pixels);
      return std::move(*elsewhere);
    }
  }
  if (!exists(ContainedPath{folder, entry.archive})) {
    throw Error::bad_input("the archive of camera \"" + entry.id + "\" is missing",
                           (folder / entry.archive).string(),
                           "Restore it from a copy of the take; `raystage render` and `raystage "
                           "export` leave the camera out with --missing-archives absent");
  }
  ArchiveReader reader(ContainedPath{folder, entry.archive}, ContainedPath{folder, entry.journal},
                       buffers, unpacked);
  // An archive truncated within its header has neither id nor frames to check.
  const auto& found = reader.description();
  const auto& model = rig.cameras[camera].model;
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input(what, (folder / entry.archive).string(),
                            "Replace it with the archive of camera \"" + entry.id +
                                "\", or correct take.json and rig.json");
  };
  if (!found.camera_id.empty() && found.camera_id != entry.id) {
    throw refuse("the archive is of camera \"" + found.camera_id + "\"");
  }
  if (found.width > 0 && (found.width != model.width() || found.height != model.height())) {
    throw refuse("its frames have " + std::to_string(found.width) + " x " +
                 std::to_string(found.height) + " pixels, the camera in rig.json " +
                 std::to_string(model.width()) + " x " + std::to_string(model.height()));
  }
  const Nanoseconds epoch = entry.archive_epoch_utc.value_or(document.epoch_utc);
  if (!found.camera_id.empty() && found.epoch_utc != epoch) {
    throw refuse("its epoch is " + format_utc(found.epoch_utc) + ", take.json says " +
                 format_utc(epoch));
  }
  if (entry.pixels) reader.set_pixel_encoding(*entry.pixels);
  const bool has_pictures = found.codec == FrameCodec::kPicture;
  if (!found.camera_id.empty() && has_pictures != entry.pixels.has_value()) {
    throw refuse(has_pictures
                     ? "its frames are JPEG XL pictures, but take.json has no \"pixels\" for it"
                     : "its frames are JPEG, but take.json states \"pixels\" of JPEG XL pictures");
  }
  reader.shift_times(epoch - document.epoch_utc);
  reader.set_take(*this, static_cast<int>(camera));
  return reader;
}

const ArchiveReader& Take::State::archive(int camera) const {
  assert(camera >= 0 && camera < camera_count());
  const auto index = static_cast<std::size_t>(camera);
  Slot& slot = slots[index];
  // Not std::call_once: with thread sanitizers it locks up if its function throws, and opening may.
  // After a failure the next caller tries again.
  if (!slot.ready.load(std::memory_order_acquire)) {
    const std::scoped_lock lock(slot.opening);
    if (!slot.ready.load(std::memory_order_relaxed)) {
      slot.reader.emplace(open(index));
      slot.ready.store(true, std::memory_order_release);
    }
  }
  return *slot.reader;
}

Take::Take(std::filesystem::path folder, std::shared_ptr<const RemoteArchives> remote)
    : state_(std::make_unique<State>(std::move(folder), std::move(remote))) {
  state_->check_cameras();
}

Take::~Take() = default;
Take::Take(Take&&) noexcept = default;
Take& Take::operator=(Take&&) noexcept = default;

const std::filesystem::path& Take::folder() const { return state_->folder; }
ContainedPath Take::file(fs::path relative) const { return {folder(), std::move(relative)}; }
const schemas::TakeDocument& Take::document() const { return state_->document; }
const rig::Rig& Take::rig() const { return state_->rig; }

void Take::check_not_inside(const fs::path& folder) const {
  std::error_code unknown;  // creating the folder reports it then
  const fs::path way = fs::weakly_canonical(folder, unknown)
                           .lexically_relative(fs::weakly_canonical(state_->folder, unknown));
  if (way.empty() || way == "." || *way.begin() == "..") return;
  throw Error::bad_input("the new take would be inside of " + state_->folder.string(),
                         folder.string(), "Give a folder outside of that take");
}

int Take::camera_count() const { return state_->camera_count(); }

int Take::camera_index(std::string_view id) const {
  const auto& cameras = state_->document.cameras;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].id == id) return static_cast<int>(i);
  }
  return -1;
}

bool Take::is_missing(int camera) const {
  return state_->remote && state_->remote->is_missing(camera);
}

UnpackedFrames& Take::unpacked_frames() const { return *state_->unpacked; }

bool Take::are_archives_unknown() const { return state_->remote && state_->remote->are_unknown(); }

const ArchiveReader& Take::archive(int camera) const { return state_->archive(camera); }

}  // namespace raystage::store
