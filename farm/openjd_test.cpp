// SPDX-License-Identifier: Apache-2.0
#include "farm/openjd.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "testing/farm/test_job.h"

namespace raystage::farm {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(OpenJd, TheTemplateKeepsThePublishedRules) {
  const schemas::FarmJobDocument job = testing::make_small_job();
  const std::string text = openjd_template(job);
  EXPECT_THAT(validate_openjd_template(text), IsEmpty()) << text;
  const json document = json::parse(text);
  EXPECT_EQ(document["specificationVersion"], "jobtemplate-2023-09");
  ASSERT_EQ(document["steps"].size(), 4U);
  const json& render = document["steps"][1];
  EXPECT_EQ(render["parameterSpace"]["taskParameterDefinitions"][0]["range"], "0-3");
  EXPECT_EQ(render["dependencies"][0]["dependsOn"], "Prepare");
  EXPECT_EQ(render["script"]["actions"]["onRun"]["timeout"], 20 * 60);
  EXPECT_EQ(document["parameterDefinitions"][0]["default"], job.folder);
}

TEST(OpenJd, StagesThatAJobLacksAreNoSteps) {
  schemas::FarmJobDocument job = testing::make_small_job();
  job.instants.clear();
  job.preview = false;
  job.chunks = {{"1", {}}};
  const std::string text = openjd_template(job);
  EXPECT_THAT(validate_openjd_template(text), IsEmpty()) << text;
  EXPECT_EQ(json::parse(text)["steps"].size(), 2U);
}

TEST(OpenJd, WordsBeforeTheCommandAreTheShells) {
  schemas::FarmJobDocument job = testing::make_small_job();
  job.command_prefix = "apptainer exec -B '/a b' /net/x.sif";
  const std::string text = openjd_template(job);
  EXPECT_THAT(validate_openjd_template(text), IsEmpty()) << text;
  const json run = json::parse(text)["steps"][1]["script"]["actions"]["onRun"];
  EXPECT_EQ(run["command"], "sh");
  EXPECT_THAT(json(run["args"]).dump(),
              HasSubstr(R"(["-c","apptainer exec -B '/a b' /net/x.sif \"$@\"","sh",)"
                        R"("{{Param.Raystage}}","farm","task")"));
}

TEST(OpenJd, EveryRuleIsChecked) {
  const json good = json::parse(openjd_template(testing::make_small_job()));
  const auto faults_with = [&](const char* pointer, const json& value) {
    json wrong = good;
    wrong[json::json_pointer(pointer)] = value;
    return validate_openjd_template(wrong.dump());
  };
  const std::string run = "/steps/1/script/actions/onRun";
  const std::vector<std::pair<std::string, json>> wrong{
      {"/specificationVersion", "jobtemplate-2024-01"},
      {"/name", std::string(129, 'x')},
      {"/name", "a\tb"},
      {"/colour", "blue"},
      {"/parameterDefinitions", json::array()},
      {"/parameterDefinitions/0/name", "not an identifier"},
      {"/parameterDefinitions/0/dataFlow", "BOTH"},
      {"/parameterDefinitions/0/default", std::string(1025, '/')},
      {"/parameterDefinitions/1/name", "JobFolder"},
      {"/steps/0/name", "Render"},
      {"/steps/0/name", std::string(65, 'x')},
      {"/steps/1/dependencies/0/dependsOn", "Nowhere"},
      {"/steps/1/hostRequirements/amounts/0/name", "vcpu"},
      {"/steps/1/hostRequirements/amounts/0/min", -1},
      {"/steps/1/parameterSpace/taskParameterDefinitions/0/range", "0..3"},
      {"/steps/1/parameterSpace/taskParameterDefinitions/0/type", "NUMBER"},
      {run + "/args/0", "{{Param.Nothing}}"},
      {run + "/args/0", 3},
      {run + "/timeout", 0},
      {run + "/cancelation/mode", "ASK"},
      {run + "/cancelation/notifyPeriodInSeconds", 601},
      {"/steps", json::array()}};
  for (const auto& [pointer, value] : wrong) {
    EXPECT_FALSE(faults_with(pointer.c_str(), value).empty()) << pointer << " = " << value;
  }
  EXPECT_FALSE(validate_openjd_template("{").empty());
  EXPECT_FALSE(validate_openjd_template("[]").empty());
}

}  // namespace
}  // namespace raystage::farm
