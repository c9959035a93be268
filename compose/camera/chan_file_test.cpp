// SPDX-License-Identifier: Apache-2.0
#include "compose/camera/chan_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <numbers>

#include "base/error.h"

namespace raystage::compose {
namespace {

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using ::testing::HasSubstr;

constexpr double kRadians = std::numbers::pi / 180;
constexpr RotationOrder kAll[] = {RotationOrder::kXyz, RotationOrder::kXzy, RotationOrder::kYxz,
                                  RotationOrder::kYzx, RotationOrder::kZxy, RotationOrder::kZyx};

std::string refusal(std::string_view text) {
  try {
    parse_chan(text, RotationOrder::kZxy, "move.chan");
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    return error.what();
  }
  return "none";
}

double apart(const Quaterniond& a, const Quaterniond& b) { return a.angularDistance(b); }

TEST(ChanFile, ReadsNukesColumns) {
  const auto lines = parse_chan(
      "# exported\n"
      "1\t1 2 3\t10 20 30 45\r\n"
      "\n"
      "  2.5 1 2 +4 10 20 30 46.5\n",
      RotationOrder::kZxy, "f");
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[1].frame, 2.5);
  EXPECT_EQ(lines[1].position, Vector3d(1, 2, 4));
  EXPECT_DOUBLE_EQ(*lines[1].vertical_fov, 46.5 * kRadians);
  // ZXY: rolled about its own axis first, then tilted, then panned.
  const Quaterniond expected = AngleAxisd(20 * kRadians, Vector3d::UnitY()) *
                               AngleAxisd(10 * kRadians, Vector3d::UnitX()) *
                               AngleAxisd(30 * kRadians, Vector3d::UnitZ());
  EXPECT_LT(apart(lines[0].orientation, expected), 1e-15);
}

TEST(ChanFile, ACameraPannedToTheLeftLooksAlongMinusX) {
  const auto lines = parse_chan("1 0 0 0 0 90 0", RotationOrder::kZxy, "f");
  EXPECT_LT((lines[0].orientation * -Vector3d::UnitZ() - -Vector3d::UnitX()).norm(), 1e-15);
  EXPECT_FALSE(lines[0].vertical_fov.has_value());
}

TEST(ChanFile, ComesBackInEveryOrder) {
  EXPECT_TRUE(rc::check([] {
    const RotationOrder order = *rc::gen::elementOf(std::vector(std::begin(kAll), std::end(kAll)));
    const bool with_fov = *rc::gen::arbitrary<bool>();
    std::vector<ChanLine> lines;
    const int count = *rc::gen::inRange(1, 6);
    const auto number = [] { return *rc::gen::inRange(-100000, 100001) * 1e-3; };
    for (int i = 0; i < count; ++i) {
      ChanLine line;
      line.frame = i * 1.5 - 3;
      line.position = {number(), number(), number()};
      line.orientation = Quaterniond(number() + 1e-4, number(), number(), number()).normalized();
      if (with_fov) line.vertical_fov = *rc::gen::inRange(1, 179) * kRadians;
      lines.push_back(line);
    }
    const auto back = parse_chan(format_chan(lines, order), order, "f");
    RC_ASSERT(back.size() == lines.size());
    for (std::size_t i = 0; i < lines.size(); ++i) {
      RC_ASSERT(back[i].frame == lines[i].frame);
      RC_ASSERT(back[i].position == lines[i].position);
      RC_ASSERT(apart(back[i].orientation, lines[i].orientation) < 1e-7);
      RC_ASSERT(back[i].vertical_fov.has_value() == with_fov);
      if (with_fov) {
        RC_ASSERT(std::abs(*back[i].vertical_fov - *lines[i].vertical_fov) < 1e-14);
      }
    }
  }));
}

TEST(ChanFile, AnglesComeBackAlsoWhereTwoAxesAreOne) {
  for (const RotationOrder order : kAll) {
    for (const double middle : {90.0, -90.0}) {
      for (int axis = 0; axis < 3; ++axis) {
        Vector3d angles(20, -35, 50);
        angles[axis] = middle;
        const Quaterniond rotation = rotation_from_angles(angles * kRadians, order);
        const Vector3d found = angles_from_rotation(rotation, order, Vector3d(0.1, 0.2, 0.3));
        EXPECT_LT(apart(rotation_from_angles(found, order), rotation), 1e-7);
      }
    }
  }
}

TEST(ChanFile, AnglesGoOnWithoutJumps) {
  // Pans left by two full turns while tilting past the zenith.
  for (const RotationOrder order : kAll) {
    std::vector<ChanLine> lines;
    for (int i = 0; i <= 200; ++i) {
      ChanLine line;
      line.frame = i;
      line.orientation =
          rotation_from_angles(Vector3d(1.3 * i, 3.6 * i, 0.2 * i + 0.05) * kRadians, order);
      lines.push_back(line);
    }
    Vector3d before = Vector3d::Zero();
    for (const ChanLine& line : lines) {
      const Vector3d angles = angles_from_rotation(line.orientation, order, before);
      EXPECT_LT((angles - before).cwiseAbs().maxCoeff(), 5 * kRadians) << line.frame;
      before = angles;
    }
    EXPECT_NEAR(before.y(), 720 * kRadians, 1e-6);
  }
}

TEST(ChanFile, SaysWhichLineIsWrong) {
  EXPECT_THAT(refusal("1 0 0 0 0 0 0\n2 0 0 zero 0 0 0"), HasSubstr("move.chan:2: found \"zero\""));
  EXPECT_THAT(refusal("1 0 0 0 0 0"), HasSubstr("found 6 numbers, allowed: 7, or 8"));
  EXPECT_THAT(refusal("1 0 0 0 0 0 0 50\n2 0 0 0 0 0 0"),
              HasSubstr("7 numbers, allowed: 8 as before"));
  EXPECT_THAT(refusal("2 0 0 0 0 0 0\n2 0 0 0 0 0 0"), HasSubstr("frame 2 after 2"));
  EXPECT_THAT(refusal("1 0 0 nan 0 0 0"), HasSubstr("allowed: a finite number"));
  EXPECT_THAT(refusal("1 0 0 inf 0 0 0"), HasSubstr("allowed: a finite number"));
  EXPECT_THAT(refusal("1 0 0 0 0 0 0 180"), HasSubstr("field of view of 180"));
  EXPECT_THAT(refusal("# nothing\n\n"), HasSubstr("the file has no line with a camera"));
  EXPECT_THAT(refusal(""), HasSubstr("the file has no line with a camera"));
}

TEST(ChanFile, KnowsTheOrdersByName) {
  EXPECT_EQ(parse_rotation_order("ZXY"), RotationOrder::kZxy);
  EXPECT_FALSE(parse_rotation_order("zxy").has_value());
}

}  // namespace
}  // namespace raystage::compose
