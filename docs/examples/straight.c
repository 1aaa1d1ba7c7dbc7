/* Drives straight on along the first heading, by the mean of all wheels.
 *
 *   cc -O2 -o straight straight.c -lm
 *   straight MEASUREMENTS ESTIMATE
 *
 * MEASUREMENTS is an ASL folder, ESTIMATE the TUM file that is written.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Read what follows a key in a YAML file into numbers; gives how many there are. */
static int numbers(const char *folder, const char *name, const char *key, double *out, int most) {
    char path[4096], line[4096];
    snprintf(path, sizeof path, "%s/mav0/%s", folder, name);
    FILE *file = fopen(path, "r");
    int count = 0;
    while (file && count == 0 && fgets(line, sizeof line, file)) {
        char *at = strstr(line, key);
        if (!at) continue;
        at += strlen(key) + strspn(at + strlen(key), ": [");
        for (char *end; count < most; at = end + strspn(end, ", ")) {
            double value = strtod(at, &end);
            if (end == at) break;
            out[count++] = value;
        }
    }
    if (file) fclose(file);
    return count;
}

int main(int words, char **word) {
    double radius, p[3], q[4];
    if (words != 3) return fprintf(stderr, "give MEASUREMENTS and ESTIMATE\n"), 2;
    if (numbers(word[1], "lpet_wheels0/sensor.yaml", "radius_m", &radius, 1) != 1) return 3;
    if (numbers(word[1], "lpet.yaml", "translation_m", p, 3) != 3) return 4;
    if (numbers(word[1], "lpet.yaml", "q_wxyz", q, 4) != 4) return 5;
    const double ahead[3] = {
        1 - 2 * (q[2] * q[2] + q[3] * q[3]),
        2 * (q[1] * q[2] + q[0] * q[3]),
        2 * (q[1] * q[3] - q[0] * q[2]),
    };

    char path[4096], line[8192];
    snprintf(path, sizeof path, "%s/mav0/lpet_wheels0/data.csv", word[1]);
    FILE *in = fopen(path, "r"), *out = fopen(word[2], "w");
    if (!in || !out) return 6;
    int wheels = 0;
    double first = NAN;
    while (fgets(line, sizeof line, in)) {
        if (line[0] == '#') {
            for (char *at = line; (at = strstr(at, "drive_angle_rad_")); at++) wheels++;
            continue;
        }
        long long stamp = strtoll(strtok(line, ","), NULL, 10);
        double turned = 0;
        for (int i = 0; i < wheels; i++) turned += strtod(strtok(NULL, ","), NULL) / wheels;
        if (isnan(first)) first = turned;
        const double way = radius * (turned - first);
        fprintf(out, "%lld.%09lld", stamp / 1000000000, stamp % 1000000000);
        for (int i = 0; i < 3; i++) fprintf(out, " %.17g", p[i] + way * ahead[i]);
        fprintf(out, " %.17g %.17g %.17g %.17g\n", q[1], q[2], q[3], q[0]);
    }
    fclose(in);
    return fclose(out) ? 7 : 0;
}
