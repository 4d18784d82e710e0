// What every C++ peer shares: a mesh file in, one line of JSON for each run that is asked for.
//
// The file: int64 counts V and F, then V × 3 float64 and F × 3 or F × 4 int32. "run" on standard input makes
// one run from arrays to arrays, connectivity included, and prints its wall and processor seconds,
// the peak memory above what stood before, and what came out.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

// What OpenSubdiv asks of points. Its weights are single precision where it is not told otherwise.
struct Point {
    double x[3];
    void Clear(void* = nullptr) { x[0] = x[1] = x[2] = 0; }
    void AddWithWeight(const Point& from, double weight) {
        for (int k = 0; k < 3; ++k) x[k] += weight * from.x[k];
    }
};

struct Arrays {
    std::vector<double> points;
    std::vector<int32_t> faces;
    int degree = 3;
    std::size_t vertex_count() const { return points.size() / 3; }
    std::size_t face_count() const { return faces.size() / degree; }
};

inline Arrays read_mesh(const char* path) {
    std::ifstream file(path, std::ios::binary);
    int64_t counts[2];
    file.read(reinterpret_cast<char*>(counts), sizeof counts);
    Arrays mesh;
    mesh.points.resize(3 * counts[0]);
    file.seekg(0, std::ios::end);
    const int64_t start = sizeof counts + 3 * counts[0] * sizeof(double);
    mesh.degree = int((int64_t(file.tellg()) - start) / int64_t(counts[1] * sizeof(int32_t)));
    file.seekg(sizeof counts);
    mesh.faces.resize(mesh.degree * counts[1]);
    file.read(reinterpret_cast<char*>(mesh.points.data()), mesh.points.size() * sizeof(double));
    file.read(reinterpret_cast<char*>(mesh.faces.data()), mesh.faces.size() * sizeof(int32_t));
    if (!file) {
        std::fprintf(stderr, "cannot read %s\n", path);
        std::exit(2);
    }
    return mesh;
}

inline long status_kib(const char* name) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.rfind(name, 0) == 0) return std::atol(line.c_str() + std::strlen(name));
    return 0;
}

template <class Subdivide>
int serve(int count, char** arguments, Subdivide subdivide, bool takes_quads = false) {
    if (count != 3) {
        std::fprintf(stderr, "usage: %s MESH LEVELS\n", arguments[0]);
        return 2;
    }
    const Arrays mesh = read_mesh(arguments[1]);
    const int levels = std::atoi(arguments[2]);
    if (mesh.degree != 3 && !takes_quads) return 3;
    for (std::string command; std::getline(std::cin, command) && command == "run";) {
        std::ofstream("/proc/self/clear_refs") << "5";
        const long before = status_kib("VmRSS:");
        const std::clock_t processor = std::clock();
        const auto start = std::chrono::steady_clock::now();
        const Arrays refined = subdivide(mesh, levels);
        const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
        const double spent = double(std::clock() - processor) / CLOCKS_PER_SEC;
        std::printf(
            "{\"seconds\": %.6f, \"processor\": %.6f, \"processor_since_start\": %.6f, "
            "\"mib\": %.1f, \"vertices\": %zu, \"faces\": %zu}\n",
            wall.count(), spent, double(std::clock()) / CLOCKS_PER_SEC, (status_kib("VmHWM:") - before) / 1024.0,
            refined.vertex_count(), refined.face_count());
        std::fflush(stdout);
    }
    return 0;
}
