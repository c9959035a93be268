// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <fstream>

#include "base/base64.h"
#include "base/error.h"
#include "testing/compose/test_meshes.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

using ::testing::HasSubstr;

// 3 x vec3 float: (0,0,0) (1,0,0) (0,1,0)
constexpr const char* kTriangle = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";

class MeshFiles : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder_.path() / name) << text;
    return folder_.path() / name;
  }
  std::string refusal(const std::filesystem::path& file) {
    try {
      read_mesh(file);
    } catch (const Error& error) {
      return error.what();
    }
    return "none";
  }
  testing::TestFolder folder_;
};

TEST_F(MeshFiles, OnlyFilesBesideTheMeshAreRead) {
  std::filesystem::create_directories(folder_.path() / "set/data");
  const std::string triangle = *decode_base64(kTriangle);
  write("private.bin", triangle);
  write("set/data/own.bin", triangle);
  std::filesystem::create_symlink("../private.bin", folder_.path() / "set/link.bin");
  const auto gltf = [&](const std::string& uri) {
    return write("set/m.gltf", R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
  "nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
  "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
  "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":")" +
                                   uri + R"("}]})");
  };
  EXPECT_EQ(read_mesh(gltf("data/own.bin")).corners.size(), 1U);
  for (const char* uri : {"../private.bin", "link.bin", "/dev/zero"}) {
    EXPECT_NE(refusal(gltf(uri)), "none") << uri;
  }
  // Neither a pipe nor a device in the place of a material library stops the mesh.
  ASSERT_EQ(mkfifo((folder_.path() / "pipe.mtl").c_str(), 0600), 0);
  for (const char* library : {"pipe.mtl", "/dev/zero"}) {
    const Mesh mesh = read_mesh(write(
        "m.obj", std::string("mtllib ") + library + "\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"));
    EXPECT_EQ(mesh.corners.size(), 1U) << library;
  }
}

TEST_F(MeshFiles, ObjWithMaterialsAndObjects) {
  write("m.mtl", "newmtl red\nKd 0.8 0.1 0.05\nnewmtl wood\nKd 1 1 1\nmap_Kd maps/wood.png\n");
  const Mesh mesh = read_mesh(write("m.obj",
                                    "mtllib m.mtl\n"
                                    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 -2\n"
                                    "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
                                    "o table\nusemtl wood\nf 1/1 2/2 3/3 4/4\n"
                                    "o cup\nusemtl red\nf 1 2 5\n"));
  EXPECT_EQ(mesh.corners.size(), 3U);  // the square as two
  ASSERT_EQ(mesh.objects.size(), 2U);
  const auto make_material = [&](const std::string& name) {
    const auto object = std::ranges::find(mesh.objects, name, &Mesh::Object::name);
    return object == mesh.objects.end() ? Material{.kind = Material::Kind::kMirror}
                                        : mesh.materials[object->material];
  };
  const Material wood = make_material("table");
  EXPECT_EQ(wood.texture.path(), folder_.path() / "maps/wood.png");
  const Material red = make_material("cup");
  EXPECT_TRUE(red.texture.relative.empty());
  EXPECT_NEAR(red.color.x(), 0.8F, 1e-6F);
  EXPECT_EQ(red.kind, Material::Kind::kDiffuse);
  EXPECT_EQ(mesh.uvs.size(), mesh.positions.size());
}

/// Nodes are nested; several may refer to one mesh.
TEST_F(MeshFiles, GltfNodesArePlacedAndNamed) {
  const Mesh mesh = read_mesh(
      write("m.gltf", std::string(R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
       "nodes":[{"name":"top","translation":[10,0,0],"children":[1,2]},
                {"name":"left","mesh":0,"translation":[0,2,0]},
                {"name":"right","mesh":0,"scale":[3,3,3]}],
       "materials":[{"pbrMetallicRoughness":{"baseColorFactor":[0.2,0.4,0.6,1],
                     "metallicFactor":1,"roughnessFactor":0.3}}],
       "meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0}]}],
       "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
                     "min":[0,0,0],"max":[1,1,0]}],
       "bufferViews":[{"buffer":0,"byteLength":36}],
       "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,)") +
                          kTriangle + R"("}]})"));
  ASSERT_EQ(mesh.objects.size(), 2U);
  EXPECT_EQ(mesh.objects[0].name, "left");
  EXPECT_EQ(mesh.objects[1].name, "right");
  double most_x = 0, most_y = 0;
  for (const Eigen::Vector3d& p : mesh.positions) {
    most_x = std::max(most_x, p.x());
    most_y = std::max(most_y, p.y());
  }
  EXPECT_EQ(most_x, 13);
  EXPECT_EQ(most_y, 3);
  const Material& metal = mesh.materials[mesh.objects[0].material];
  EXPECT_EQ(metal.kind, Material::Kind::kGlossy);
  EXPECT_NEAR(metal.roughness, 0.3F, 1e-6F);
  EXPECT_NEAR(metal.color.y(), 0.4F, 1e-6F);
}

/// Blender's default for GLB; here as data URIs.
TEST_F(MeshFiles, TexturesInTheFile) {
  const auto gltf = [&](const std::string& image) {
    return std::string(R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
       "nodes":[{"name":"box","mesh":0}],"images":[{"name":"wood","mimeType":"image/png",
         "uri":"data:image/png;base64,)") +
           image + R"("}],
       "textures":[{"source":0}],
       "materials":[{"name":"a","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}},
                    {"name":"b","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}},
                    {"name":"c","pbrMetallicRoughness":{"baseColorFactor":[0.2,0.4,0.6,1]}}],
       "meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0},
                                {"attributes":{"POSITION":0},"material":1},
                                {"attributes":{"POSITION":0},"material":2}]}],
       "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
                     "min":[0,0,0],"max":[1,1,0]}],
       "bufferViews":[{"buffer":0,"byteLength":36}],
       "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,)" +
           kTriangle + R"("}]})";
  };
  const Mesh mesh = read_mesh(write("m.gltf", gltf(testing::kQuarteredPng)));
  ASSERT_EQ(mesh.objects.size(), 3U);  // one per material, of one name
  EXPECT_EQ(mesh.objects[2].name, "box");
  const auto material = [&](std::size_t object) {
    return mesh.materials[mesh.objects[object].material];
  };
  ASSERT_NE(material(0).embedded_texture, nullptr);
  EXPECT_EQ(material(0).embedded_texture, material(1).embedded_texture);
  EXPECT_EQ(material(0).embedded_texture->format, "png");
  EXPECT_EQ(material(0).embedded_texture->bytes, *decode_base64(testing::kQuarteredPng));
  EXPECT_TRUE(material(0).texture.relative.empty());
  EXPECT_EQ(material(2).embedded_texture, nullptr);
  EXPECT_NEAR(material(2).color.y(), 0.4F, 1e-6F);
  // Refused when it is used: a shot may replace it.
  const Mesh unreadable = read_mesh(write("text.gltf", gltf("aGVsbG8gd29ybGQ=")));
  EXPECT_EQ(unreadable.materials[0].embedded_texture->format, "");
}

/// A triangle of 100 centimetres, as text.
TEST_F(MeshFiles, FbxIsInMetres) {
  const auto file = write("m.fbx", R"(; FBX 7.4.0 project file
FBXHeaderExtension:  {
	FBXHeaderVersion: 1003
	FBXVersion: 7400
}
GlobalSettings:  {
	Version: 1000
	Properties70:  {
		P: "UpAxis", "int", "Integer", "",1
		P: "UpAxisSign", "int", "Integer", "",1
		P: "FrontAxis", "int", "Integer", "",2
		P: "FrontAxisSign", "int", "Integer", "",1
		P: "CoordAxis", "int", "Integer", "",0
		P: "CoordAxisSign", "int", "Integer", "",1
		P: "UnitScaleFactor", "double", "Number", "",1
	}
}
Objects:  {
	Geometry: 1000, "Geometry::tri", "Mesh" {
		Vertices: *9 {
			a: 0,0,0,100,0,0,0,100,0
		}
		PolygonVertexIndex: *3 {
			a: 0,1,-3
		}
	}
	Model: 2000, "Model::tri", "Mesh" {
		Version: 232
		Properties70:  {
			P: "Lcl Translation", "Lcl Translation", "", "A",0,0,-300
		}
	}
}
Connections:  {
	C: "OO",2000,0
	C: "OO",1000,2000
}
)");
  const auto most = [](const Mesh& mesh) {
    Eigen::Vector3d corner = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& p : mesh.positions) corner = corner.cwiseMax(p.cwiseAbs());
    return corner;
  };
  EXPECT_LT((most(read_mesh(file)) - Eigen::Vector3d(1, 1, 3)).norm(), 1e-6);
  const MeshFile raw = read_mesh_file(file, {.applies_unit = false});
  const Mesh units = MeshFile::place(raw.mesh, raw.parts, raw.file_from_node, file);
  EXPECT_LT((most(units) - Eigen::Vector3d(100, 100, 300)).norm(), 1e-4);
}

TEST_F(MeshFiles, PlyHasNoMaterial) {
  const Mesh mesh = read_mesh(write("m.ply",
                                    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                                    "property float y\nproperty float z\nelement face 1\n"
                                    "property list uchar int vertex_indices\nend_header\n"
                                    "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"));
  EXPECT_EQ(mesh.corners.size(), 1U);
  EXPECT_TRUE(mesh.normals.empty());
  EXPECT_EQ(mesh.materials[mesh.objects[0].material].kind, Material::Kind::kDiffuse);
}

TEST_F(MeshFiles, SaysWhatIsWrong) {
  EXPECT_THAT(refusal(folder_.path() / "none.obj"), HasSubstr("the mesh file does not exist"));
  EXPECT_THAT(refusal(write("text.obj", "hello\n")), HasSubstr("text.obj"));
  EXPECT_THAT(refusal(write("cut.gltf", "{\"asset\": {")), HasSubstr("cut.gltf"));
  EXPECT_THAT(refusal(write("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n")),
              HasSubstr("not finite"));
}

}  // namespace
}  // namespace raystage::compose
