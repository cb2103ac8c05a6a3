// rbvh ingest: every option, inputs and outputs of every kind, the report.
#include <nlohmann/json.hpp>

#include "rbvh/scan.h"
#include "tests/run_tool.h"
#include "tests/scan_bytes.h"

namespace rbvh {
namespace {

using Json = nlohmann::json;

/// A flat grid of side x side points with spacing 1 at height z.
std::string grid(int side, double z) {
  std::string text;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      text += std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + "\n";
  return text;
}

class Ingest : public ToolTest {
 protected:
  RawScan ingested(const std::string& words) {
    const ToolRun run = tool("ingest " + words + " -o out.ply -f");
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_EQ(run.out, "");
    return parse_scan(read("out.ply"), "out.ply");
  }
  Json reported(const std::string& words) {
    ingested(words + " --report report.json");
    return Json::parse(read("report.json"));
  }
};

TEST_F(Ingest, EveryFormatGivesTheSameMesh) {
  write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  write("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  write("a.stl",
        "solid\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n");
  write("a b.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  ingested("a.obj");
  const std::string expected = read("out.ply");
  write("again.ply", expected);
  for (const char* name : {"a.off", "a.stl", "'a b.ply'", "again.ply"}) {
    ingested(name);
    EXPECT_EQ(read("out.ply"), expected) << name;
  }
  EXPECT_EQ(tool("ingest a.obj -o -").out, expected);
  EXPECT_EQ(tool("ingest - -o piped.ply < a.off").code, 0);
  EXPECT_EQ(read("piped.ply"), expected);
}

TEST_F(Ingest, SeveralInputsAreObjects) {
  write("a.xyz", grid(10, 0));
  write("b.xyz", grid(10, 5));
  write("c.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const Json report = reported("a.xyz b.xyz a.xyz");
  EXPECT_EQ(report["objects"], 3);
  EXPECT_EQ(report["vertices_out"], 300);
  const ToolRun run = tool("ingest a.xyz c.obj -o mixed.ply");
  EXPECT_EQ(run.code, 3);
  EXPECT_EQ(run.lines(), 1);
  EXPECT_NE(run.err.find("c.obj: a mesh and a cloud"), std::string::npos) << run.err;
  EXPECT_FALSE(exists("mixed.ply"));
}

TEST_F(Ingest, TheReportHasEveryCount) {
  write("a.ply",
        "ply\nformat ascii 1.0\nelement vertex 7\nproperty double x\nproperty double y\nproperty double z\n"
        "element face 6\nproperty list uchar int vertex_indices\nend_header\n500000 5000000 0\n500001 "
        "5000000 0\n"
        "500000 5000001 0\nnan 0 0\n500000 5000000 0\n500000.5 5000000 0\n500000 5000000 9\n"
        "3 0 1 2\n3 0 1 3\n3 1 2 4\n3 0 1 5\n3 0 2 1\n3 0 1 2\n");
  const Json report = reported("a.ply");
  EXPECT_EQ(report["kind"], "mesh");
  EXPECT_EQ(report["vertices_in"], 7);
  EXPECT_EQ(report["faces_in"], 6);
  EXPECT_EQ(report["removed"]["non_finite_vertices"], 1);
  EXPECT_EQ(report["removed"]["non_finite_faces"], 1);
  EXPECT_EQ(report["removed"]["duplicate_vertices"], 1);
  EXPECT_EQ(report["removed"]["zero_area_faces"], 1);
  EXPECT_EQ(report["removed"]["duplicate_faces"], 2);
  EXPECT_EQ(report["removed"]["unreferenced_vertices"], 2);
  EXPECT_EQ(report["vertices_out"], 3);
  EXPECT_EQ(report["removed"]["coincident_faces"]["sheets"], 1);
  EXPECT_EQ(report["faces_out"], 1);
  EXPECT_EQ(report["shift"][0], 500001);
  EXPECT_EQ(report["bounds"], Json::parse(tool("info out.ply --json").out)["bounds"]);
  EXPECT_EQ(report["area"], 0.5);
  EXPECT_TRUE(report["timings"].contains("read"));
}

TEST_F(Ingest, Outliers) {
  write("a.xyz", grid(20, 0) + "5 5 60\n");
  EXPECT_EQ(ingested("a.xyz").positions.size(), 401u);
  EXPECT_EQ(ingested("a.xyz --outliers 8,3").positions.size(), 400u);
  for (const char* wrong : {"8", "8,", "0,1", "8,-1", "8,1,2", "a,b", "8,nan"})
    EXPECT_EQ(tool(std::string("ingest a.xyz -o b.ply --outliers ") + wrong).code, 2) << wrong;
}

TEST_F(Ingest, Voxel) {
  write("a.xyz", grid(20, 0));
  EXPECT_EQ(ingested("a.xyz --voxel 2").positions.size(), 100u);
  EXPECT_EQ(tool("ingest a.xyz -o b.ply --voxel 0").code, 2);
}

TEST_F(Ingest, Class) {
  std::string points = "x y z classification\n";
  for (int i = 0; i < 100; ++i)
    points += std::to_string(i % 10) + " " + std::to_string(i / 10) + " 0 " +
              std::to_string(i < 60   ? 2
                             : i < 90 ? 6
                                      : 7) +
              "\n";
  write("a.xyz", points);
  const Json report = reported("a.xyz --class 2,7");
  EXPECT_EQ(report["vertices_out"], 70);
  EXPECT_EQ(report["removed"]["other_classes"], 30);
  EXPECT_EQ(ingested("a.xyz --class 6").properties.at(0).values, std::vector<float>(30, 6));
  EXPECT_NE(tool("ingest a.xyz -o b.ply --class 6").err.find("left out: 70 points of other classes"),
            std::string::npos);
  write("plain.xyz", grid(10, 0));
  write("mesh.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_EQ(tool("ingest a.xyz -o c.ply --class 9").code, 3);
  EXPECT_EQ(tool("ingest plain.xyz -o c.ply --class 2").code, 2);
  EXPECT_EQ(tool("ingest mesh.obj -o c.ply --class 2").code, 2);
  for (const char* wrong : {"256", "-1", "2,", "ground", "2.5"})
    EXPECT_EQ(tool(std::string("ingest a.xyz -o c.ply --class ") + wrong).code, 2) << wrong;
}

TEST_F(Ingest, MinComponent) {
  write("a.xyz", grid(20, 0) + grid(4, 50));
  EXPECT_EQ(ingested("a.xyz").positions.size(), 416u);
  EXPECT_EQ(ingested("a.xyz --min-component 0.1").positions.size(), 400u);
  EXPECT_EQ(tool("ingest a.xyz -o b.ply --min-component 2").code, 2);
}

TEST_F(Ingest, NormalsOptions) {
  std::string with_normals = "x y z nx ny nz\n";
  for (int i = 0; i < 100; ++i)
    with_normals += std::to_string(i % 10) + " " + std::to_string(i / 10) + " 0 1 0 0\n";
  write("a.xyz", with_normals);
  write("b.xyz", grid(10, 0));
  EXPECT_EQ(ingested("a.xyz").normals[5], (Vec3f{1, 0, 0}));
  EXPECT_EQ(ingested("a.xyz --recompute-normals").normals[5], (Vec3f{0, 0, 1}));
  EXPECT_EQ(ingested("b.xyz").normals[5], (Vec3f{0, 0, 1}));
  EXPECT_EQ(ingested("b.xyz --flip-normals").normals[5], (Vec3f{0, 0, -1}));
  EXPECT_EQ(ingested("b.xyz --viewpoint 5,5,-20").normals[5], (Vec3f{0, 0, -1}));
  // With more neighbours the crease of a roof is rounder.
  std::string roof;
  for (int i = 0; i < 400; ++i)
    roof += std::to_string(i % 20) + " " + std::to_string(i / 20) + " " +
            std::to_string(std::abs(i % 20 - 9)) + "\n";
  write("roof.xyz", roof);
  EXPECT_NE(ingested("roof.xyz --normals-k 4").normals, ingested("roof.xyz --normals-k 60").normals);
  EXPECT_EQ(tool("ingest b.xyz -o c.ply --normals-k 2").code, 2);
  EXPECT_EQ(tool("ingest b.xyz -o c.ply --viewpoint 1,2").code, 2);
}

TEST_F(Ingest, ViewpointIsInTheInputsCoordinates) {
  std::string far;
  for (int i = 0; i < 100; ++i)
    far += std::to_string(500000 + i % 10) + " " + std::to_string(5000000 + i / 10) + " 100\n";
  write("a.xyz", far);
  EXPECT_EQ(ingested("a.xyz --viewpoint 500005,5000005,90").normals[5], (Vec3f{0, 0, -1}));
  EXPECT_EQ(ingested("a.xyz --viewpoint 500005,5000005,110").normals[5], (Vec3f{0, 0, 1}));
}

TEST_F(Ingest, IdenticalForAnyThreadsAndLocale) {
  std::string points;
  for (int i = 0; i < 9000; ++i)
    points += std::to_string(i % 90 + 0.3 * std::sin(i)) + " " + std::to_string(i / 90) + " " +
              std::to_string(std::sin(0.01 * i)) + "\n";
  write("a.xyz", points);
  ingested("a.xyz --threads 1");
  const std::string one = read("out.ply");
  ingested("a.xyz --threads 3");
  EXPECT_EQ(read("out.ply"), one);
  EXPECT_EQ(tool("ingest a.xyz -o out.ply -f", "LC_ALL=de_DE.UTF-8").code, 0);
  EXPECT_EQ(read("out.ply"), one);
}

TEST_F(Ingest, OutputsThatCannotBe) {
  write("a.xyz", grid(3, 0));
  write("there.ply", "mine");
  EXPECT_EQ(tool("ingest a.xyz -o there.ply").code, 1);
  EXPECT_EQ(read("there.ply"), "mine");
  EXPECT_EQ(tool("ingest a.xyz -o /dev/full").code, 1);
  EXPECT_EQ(tool("ingest a.xyz -o a.xyz/b.ply").code, 1);
  EXPECT_EQ(tool("ingest a.xyz -o b.obj").code, 2);
  EXPECT_EQ(tool("ingest a.xyz -o b.ply --memory 1K").code, 5);
  EXPECT_EQ(tool("ingest . -o b.ply").code, 3);
  EXPECT_EQ(files(), "a.xyz there.ply");
}

TEST_F(Ingest, WhatIsNotKeptIsSaid) {
  write("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const ToolRun run = tool("ingest a.obj -o out.ply");
  EXPECT_NE(run.err.find("warning: a.obj: its materials are not there: 'a.mtl'"), std::string::npos)
      << run.err;
  EXPECT_NE(run.err.find("out.ply: 1 triangle, 3 vertices"), std::string::npos) << run.err;
}

}  // namespace
}  // namespace rbvh
