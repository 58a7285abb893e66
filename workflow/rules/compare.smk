# tables -> differences from the reference
# what numbers depend on
OF_NUMBERS = {
    key: section for key, section in STUDY.items() if key not in ("results", "reference", "figures")
}


# what there may be of it
REFERENCE = [
    f"{STUDY['reference']}/{file}"
    for file in ("origin.json", *(f"{name}.csv" for name in COMPARED))
]


rule compare_reference:
    input:
        tables=[out(f"tables/{name}.csv") for name in COMPARED],
        reference=[file for file in REFERENCE if os.path.exists(file)],
    output:
        summary=table("reference_summary"),
        differences=table("reference_differences"),
    log:
        log_of("compare_reference"),
    benchmark:
        benchmark_of("compare_reference")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={"study": OF_NUMBERS, "code": script_code("compare_reference.py")},
    message:
        "Tables beside the reference"
    script:
        "../scripts/compare_reference.py"
